"""The signals that end a program in good order: Ctrl-C, SIGTERM, and SIGHUP where nobody told it to outlive its terminal."""

import signal


def ending_signals() -> tuple[signal.Signals, ...]:
    """SIGINT, SIGTERM, and SIGHUP (a terminal or an ssh session that is gone) unless it is ignored, as under ``nohup``."""
    outlives = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    return (signal.SIGINT, signal.SIGTERM, *(() if outlives else (signal.SIGHUP,)))
