"""That a node's machine file is not that of the machine which a configuration names."""

from boom_input.shown import quoted


def foreign(named: str, own: str, what: str) -> str:
    """That a configuration names another machine than ``own``, which ``what`` ("the laws are for") tells; empty: it does not."""
    if named == own:
        return ""
    return f"the configuration names {quoted(named) or 'no machine'}, {what} {own}"
