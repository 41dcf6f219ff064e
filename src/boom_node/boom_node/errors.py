"""What a node raises on purpose."""


class StartError(Exception):
    """A node cannot start or continue: a bad parameter, an unreadable file, a missing partner.

    The message is one line for the user: what is wrong and what to do. `boom_node.shell.run` prints it and ends with
    status 2.
    """


class HelpError(Exception):
    """``--help`` was given; the message is the help."""
