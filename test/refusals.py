"""What a refused command says."""

from __future__ import annotations


def refusal(printed: str) -> str:
    """The one line that a command refused with; what it was reading may stand above it where it took over 2 s."""
    said = [line for line in printed.splitlines() if not line.startswith("boom: reading ")]
    assert len(said) == 1 and said[0].startswith("boom: "), printed[-2000:]
    return said[0]
