"""Makes the helper modules of these tests importable, whichever way pytest was started; a case whose fits are given."""

import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def case() -> Any:
    """A case whose first round begins with 1000 nats too many."""
    from rounds_cases import first_round

    return first_round()
