"""The entry point of the commands: finds and loads the requested command and prints errors in one line.

A command is a module of `boom_bringup.commands` (`import-can` is `import_can`, `import` is `import_`) with

- `HELP`: one line, a plain string constant (read without importing the module),
- `add_arguments(parser)`: its options, added to an `argparse.ArgumentParser`; module and options need the standard library only,
  so that `./boom` can explain them before anything is installed,
- `run(args) -> int`: does the work and returns the exit status,
- `VERBATIM` (optional): name of the attribute of `args` that takes all words unchanged, except a lone --help,
- `REST` (optional): name of the attribute of `args` that takes the words which `add_arguments` did not declare.

Exit status: 0 success, 1 the work was done with a negative result, 2 wrong input, 130 stopped by Ctrl-C, 143 by SIGTERM, 129 by
SIGHUP.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import errno
import importlib
import keyword
import os
import re
import signal
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from io import TextIOWrapper
from pathlib import Path
from threading import current_thread, main_thread
from types import FrameType, ModuleType
from typing import Any, NoReturn, TextIO, cast

from boom_bringup import __version__
from boom_input.ending import ending_signals
from boom_input.shown import printable, quoted

# The order of the help: what a newcomer needs first comes first.
_ORDER = (
    "demo", "test", "validate", "view", "chain", "identify", "diagnose", "fleet", "prove", "robustness", "simulate", "sim",
    "replay", "record", "watch", "import", "import-can", "new-machine", "check-machine", "export-fmu", "setup", "python",
)  # fmt: skip
_HELP = ("-h", "--help", "help")
_ASKS = (["--help"], ["-h"])
LONGEST_LINE = 1000
"""Largest number of characters of an error message."""
_BUILT = {
    "boom_interfaces": "the messages boom_interfaces are not installed: pip does not install them with boom, because they "
    "need a C++ build; in the repository: pip install ./src/boom_interfaces, or colcon build",
    "rclpy": "ROS 2 is not installed here: use ./boom, or source an installation and its workspace",
}
_COMMANDS = Path(__file__).with_name("commands")
_DESCRIPTION = "Model, recordings and control of a forestry crane's inner boom, as ROS 2 processes."
_EPILOG = "Every command has its own help, for example: {program} help validate"


class UsageError(ValueError):
    """Wrong input on the command line; the message says what is wrong and what to do."""

    exit_status = 2


class _CommandParser(argparse.ArgumentParser):
    """Reports a wrong option in one line, with the nearest valid one; -2.8e-1 is a number, as -0.28 is."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._negative_number_matcher = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$")

    def error(self, message: str) -> NoReturn:
        if message.startswith("unrecognized arguments: "):
            wrong = message.split(": ", 1)[1].split()[0]
            known = [name for action in self._actions for name in action.option_strings]
            near = difflib.get_close_matches(wrong.split("=")[0], known, n=1)
            message = f"unknown option {wrong}" + (f" (did you mean {near[0]}?)" if near else "")
        if message.startswith("the following arguments are required: ") and (dashed := _dashed()):
            message += f"; {quoted(dashed, 80)} counts as an option: write ./{quoted(dashed, 80)} or give it behind --"
        kind = re.search(r"invalid (\w+) value: (.*)", message)  # the name of a function, if nobody says it better
        if kind:
            wanted = "a whole number" if kind[1] == "int" else "a number"
            message = f"{message[: kind.start()]}{kind[2]} is not {wanted}"
        raise UsageError(f"{message}; see {self.prog} --help")


def _dashed() -> str:
    """A file that was given by a name that begins with a dash, or nothing."""
    return next((word for word in sys.argv[1:] if word.startswith("-") and Path(word).exists()), "")


def command_names() -> list[str]:
    """List the commands that exist, in the order of the help."""
    found = {
        path.stem.rstrip("_").replace("_", "-") for path in _COMMANDS.glob("*.py") if not path.stem.startswith("_")
    }
    known = [name for name in _ORDER if name in found]
    return [*known, *sorted(found - set(known))]


def only_asks(arguments: Sequence[str]) -> bool:
    """Tell whether the words ask for help or the version, or name no command: this needs the standard library only."""
    return not arguments or arguments[0] not in command_names() or list(arguments[1:]) in _ASKS


def module_name(name: str) -> str:
    """The module of a command in `boom_bringup.commands`: a keyword of Python gets an underscore."""
    return f"{name}_" if keyword.iskeyword(name) else name.replace("-", "_")


def command_help(name: str) -> str:
    """Read the one-line help of a command without importing it."""
    tree = ast.parse((_COMMANDS / f"{module_name(name)}.py").read_text(encoding="utf-8"))
    for statement in tree.body:
        targets = statement.targets if isinstance(statement, ast.Assign) else []
        if isinstance(statement, ast.AnnAssign):
            targets = [statement.target]
        if any(isinstance(target, ast.Name) and target.id == "HELP" for target in targets):
            value = getattr(statement, "value", None)
            if value is not None:
                return str(ast.literal_eval(value))
    return ""


def _print_help(program: str) -> None:
    names = command_names()
    width = max(len(name) for name in names)
    lines = [f"usage: {program} COMMAND [OPTIONS]", "", _DESCRIPTION, "", "commands:"]
    lines += [f"  {name:<{width}}  {command_help(name)}" for name in names]
    lines += ["", "options:", f"  {'--help':<{width}}  show this text", f"  {'--version':<{width}}  show the version"]
    lines += ["", _EPILOG.format(program=program)]
    print("\n".join(lines))


def _run(arguments: Sequence[str], program: str) -> int:
    words = list(arguments)
    if words and words[0] in _HELP:
        asked = [word for word in words if word not in _HELP]
        words = [asked[0], "--help"] if asked else []
    if not words:
        _print_help(program)
        return 0
    if words[0] == "--version":
        print(f"boom {__version__}")
        return 0
    name, names = words[0], command_names()
    if name not in names:
        near = difflib.get_close_matches(name.lower(), names, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(names)}"
        raise UsageError(f"unknown command {name}: {hint}")
    module = importlib.import_module(f"boom_bringup.commands.{module_name(name)}")
    args = parse(module, f"{program} {name}", words[1:])
    _keep_inputs(vars(args))
    return int(module.run(args))


_WRITTEN = ("output", "json", "report", "write_mapping", "document", "manoeuvre", "publish")
"""Options that name what a command writes."""


def _keep_inputs(given: Mapping[str, Any]) -> None:
    """Raises UsageError: what would be written is an input, lies in a bag that is one, or is written twice."""
    written = [
        (f"--{n.replace('_', '-')}", Path(os.path.realpath(given[n]))) for n in _WRITTEN if _names_a_path(given.get(n))
    ]
    for k, (option, path) in enumerate(written):
        twice = next((other for other, same in written[:k] if same == path), "")
        if twice:
            raise UsageError(f"{twice} and {option} are the same file, {path.name}: give each a path of its own")
    words = (w for n, v in given.items() if n not in _WRITTEN for w in (v if isinstance(v, list) else [v]))
    for source in (Path(os.path.realpath(word)) for word in words if _names_a_path(word)):
        if not (os.path.isfile(source) or os.path.isfile(source / "metadata.yaml")):
            continue
        for option, path in written:
            if path == source or source in path.parents:
                where = "is" if path == source else "lies in"
                raise UsageError(
                    f"{option} {path.name} {where} the input {source.name}, which would be lost: give another path"
                )


def _names_a_path(word: object) -> bool:
    return isinstance(word, str) and bool(word) and "://" not in word and "\0" not in word and len(word) < 4096


def parse(module: ModuleType, prog: str, words: list[str]) -> argparse.Namespace:
    """Parse the words after the name of a command.

    Raises:
        UsageError: the command does not accept an option or a value.
    """
    parser = _CommandParser(
        prog=prog,
        description=module.__doc__ or module.HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    module.add_arguments(parser)
    verbatim, rest = getattr(module, "VERBATIM", None), getattr(module, "REST", None)
    if verbatim is not None and words not in _ASKS:
        return argparse.Namespace(**{verbatim: words})
    if rest is None:
        args = parser.parse_args(words)
    else:
        args, left = parser.parse_known_args(words)
        setattr(args, rest, [word for word in left if word != "--"])
    for action in parser._actions:
        if action.dest in _WRITTEN and getattr(args, action.dest) == "":
            raise UsageError(f"{(*action.option_strings, action.metavar)[0]} is empty: give a path")
    return args


class _Shown:
    """A text stream without control characters; ``obeyed`` is the stream below it, for our own colours."""

    def __init__(self, stream: TextIO) -> None:
        self.obeyed = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self.obeyed, name)

    def write(self, text: str) -> int:
        self.obeyed.write(printable(text))
        return len(text)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; foreign control characters in its output do not reach the terminal.

    Args:
        arguments: the command and its options; those of the process by default.

    Returns:
        The exit status. An exception that carries an `exit_status` becomes one line on stderr and that status.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # what the terminal's encoding lacks is shown by its number
            stream.reconfigure(errors="backslashreplace")
    with open(os.devnull, "w", encoding="utf-8") as nowhere:  # a stream that the caller has closed (`>&-`)
        shown = (cast(TextIO, _Shown(stream or nowhere)) for stream in (sys.stdout, sys.stderr))
        with redirect_stdout(next(shown)), redirect_stderr(next(shown)):
            return _guarded(arguments)


_stopped = list[int]()
"""Signals that came. An import that one interrupts may make an ImportError of it, with a page of advice (numpy)."""


def _stop(number: int, _frame: FrameType | None) -> NoReturn:
    _stopped.append(number)
    raise KeyboardInterrupt


def _stoppable() -> None:
    """A Ctrl-C, and SIGTERM and SIGHUP like it, ends the work where it is, and what is half written goes."""
    _stopped.clear()
    if current_thread() is not main_thread():
        return
    for number in ending_signals():
        # not in a program that has its own
        if signal.getsignal(number) in (signal.default_int_handler, signal.SIG_DFL):
            signal.signal(number, _stop)


def _told_stopped() -> int:
    # CPython ends by the signal where a Ctrl-C has once passed a text that is executed (as dataclasses do while they are imported),
    # although it was caught; the next such text forgets it.
    exec("")
    print("boom: stopped", file=sys.stderr)
    return 128 + (_stopped[0] if _stopped else signal.SIGINT)


def _of_the_system(error: OSError) -> str:
    if error.filename:
        return f"{error.filename}: {error.strerror}"
    free = "raise the limit (ulimit -f)" if error.errno == errno.EFBIG else "free some space"
    said = f": what was to be written last, a file or this output, is cut: {free} and repeat"
    full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    return f"{error.strerror}{said if full else ''}"


def _guarded(arguments: Sequence[str] | None) -> int:
    program = os.environ.get("BOOM_PROGRAM", "boom")
    try:
        _stoppable()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # held back by ./boom until here
        status = _run(sys.argv[1:] if arguments is None else arguments, program)
        sys.stdout.flush()
        return status
    except KeyboardInterrupt:
        return _told_stopped()
    except BrokenPipeError:
        # The reader of our output has left (`| head`): nothing is wrong, and nothing more can be written.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except Exception as error:
        if _stopped:
            return _told_stopped()
        # The packages' own error classes are not imported here: what marks them is the attribute.
        wanted = getattr(error, "exit_status", None)
        text = str(error)
        if isinstance(error, OSError) and error.strerror:  # a full disk, a folder that may not be written
            text, wanted = _of_the_system(error), 2
        elif isinstance(error, MemoryError):
            text, wanted = "not enough memory: give a shorter recording or duration", 2
        elif isinstance(error, ModuleNotFoundError) and error.name in _BUILT:
            text, wanted = _BUILT[error.name], 2
        if not isinstance(wanted, int):
            raise
        with suppress(OSError):  # stderr is full, too
            print(f"boom: {quoted(text, LONGEST_LINE)}", file=sys.stderr, flush=True)
        return wanted


if __name__ == "__main__":
    done = main()
    # What is done stays done: Python, while it ends, would die by the signal.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for ending in ending_signals()[1:]:
        signal.signal(ending, signal.SIG_DFL)
    sys.exit(done)
