"""Makes foreign text safe to show: a file name may hold escape sequences that move the cursor, or a million characters."""

from __future__ import annotations

import unicodedata

LONGEST = 200
"""Largest number of characters of foreign text that a message quotes."""

_UNSHOWN = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})


def printable(text: object) -> str:
    r"""The text with control characters written as ``\x1b``; line ends and tabs stay."""
    text = str(text)
    if text.isprintable():  # the usual case, and fast
        return text
    return "".join(c if c in "\n\t" or unicodedata.category(c) not in _UNSHOWN else _escaped(c) for c in text)


def quoted(text: object, longest: int = LONGEST) -> str:
    """The text on one line, printable; of more than `longest` characters the middle is left out."""
    text = str(text)
    if len(text) > 8 * longest:  # enough for both ends, whatever becomes of each character
        text = text[: 4 * longest] + text[-4 * longest :]
    text = printable(" ".join(text.split()))
    if len(text) <= longest:
        return text
    tail = longest // 3
    return f"{text[: longest - tail - 3]}...{text[len(text) - tail :]}"


def _escaped(character: str) -> str:
    return character.encode("unicode_escape", "surrogatepass").decode("ascii")
