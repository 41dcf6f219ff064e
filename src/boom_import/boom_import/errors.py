"""The error of this package."""


class ImportingError(ValueError):
    """A file or mapping cannot be used; one line for the user: which file, what is wrong, what to do."""

    exit_status = 2
