"""The error of this package."""


class RecordingError(Exception):
    """A recording cannot be read or written: no such file, no bag, a topic missing, two machines in one bag.

    The message is one line for the user: which file, what is wrong, what to do.
    """

    exit_status = 2
