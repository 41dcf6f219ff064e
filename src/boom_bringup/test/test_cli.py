import errno
import importlib.util
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from boom_bringup import __version__, cli, outputs, showing

ROOT = Path(__file__).resolve().parents[3]
BAG = ROOT / "bags" / "healthy" / "extended"


def test_help_lists_every_command_with_its_line(capsys):
    assert cli.main(["--help"]) == 0
    text = capsys.readouterr().out

    for name in cli.command_names():
        assert cli.command_help(name)
        assert cli.command_help(name) in text


def test_no_command_shows_the_help(capsys):
    assert cli.main([]) == 0
    assert capsys.readouterr().out.startswith("usage: ")


def test_version_is_printed(capsys):
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"boom {__version__}\n"


def test_an_unknown_command_names_the_nearest(capsys):
    assert cli.main(["tset"]) == 2
    assert capsys.readouterr().err == "boom: unknown command tset: did you mean test?\n"


def test_an_unknown_option_names_the_nearest(capsys):
    assert cli.main(["setup", "--hlep"]) == 2
    error = capsys.readouterr().err
    assert "unknown option --hlep (did you mean --help?)" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("words", [["help", "import-can"], ["--help", "import-can"], ["import-can", "-h"]])
def test_help_for_a_command_explains_its_options(words, capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(words)
    assert ended.value.code == 0
    assert "--dbc FILE" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["import_can", "x"], ["help", "import_can"], ["IMPORT-CAN"]])
def test_another_spelling_of_a_command_is_answered_with_the_right_one(words, capsys):
    assert cli.main(words) == 2
    assert capsys.readouterr().err.endswith("did you mean import-can?\n")


def test_help_loads_neither_ros_nor_the_solvers():
    heavy = ("rclpy", "casadi", "numpy", "scipy", "pinocchio", "rosbags", "plotly")
    code = f"import sys; from boom_bringup import cli; cli.main([]); sys.exit(any(m in sys.modules for m in {heavy}))"
    assert subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL, check=False).returncode == 0


def test_an_error_with_an_exit_status_becomes_one_line(monkeypatch, capsys):
    class WrongError(Exception):
        exit_status = 2

    def fail(arguments, program):
        raise WrongError("bag x has no\n/joint_states: record it")

    monkeypatch.setattr(cli, "_run", fail)
    assert cli.main(["x"]) == 2
    assert capsys.readouterr().err == "boom: bag x has no /joint_states: record it\n"


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (OSError(28, "No space left on device", "out.json"), "boom: out.json: No space left on device\n"),
        (
            OSError(errno.EFBIG, "File too large"),
            "boom: File too large: what was to be written last, a file or this output, is cut: "
            "raise the limit (ulimit -f) and repeat\n",
        ),
        (MemoryError(), "boom: not enough memory: give a shorter recording or duration\n"),
    ],
)
def test_a_full_disk_or_memory_becomes_one_line_and_status_2(error, line, monkeypatch, capsys):
    def fail(arguments, program):
        raise error

    monkeypatch.setattr(cli, "_run", fail)
    assert cli.main(["setup"]) == 2
    assert capsys.readouterr().err == line


@pytest.mark.parametrize("words", [["--seed", "-1"], ["--duration", "1e9"], ["--duration", "nan"]])
def test_impossible_options_are_refused_before_any_work(words, capsys):
    assert cli.main(["simulate", "no_such_bag", "--output", "nowhere", *words]) == 2
    error = capsys.readouterr().err
    assert words[0] in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("replay", "bag", "--rate", "abc"), "argument --rate: abc is not a number"),
        (("replay", "bag", "--start", "nan"), "argument --start: nan is not a number"),
        (("diagnose", "bag", "--seed", "x"), "argument --seed: 'x' is not a whole number"),
    ],
)
def test_a_word_that_is_no_number_is_called_so(words, said, capsys):
    assert cli.main(words) == 2
    assert re.fullmatch(rf"boom: {re.escape(said)}; see (\./)?boom {words[0]} --help\n", capsys.readouterr().err)


def test_a_fault_of_ours_keeps_its_traceback(monkeypatch):
    def fail(arguments, program):
        raise ZeroDivisionError

    monkeypatch.setattr(cli, "_run", fail)
    with pytest.raises(ZeroDivisionError):
        cli.main(["x"])


def test_interruption_ends_with_130(monkeypatch, capsys):
    def interrupt(arguments, program):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "_run", interrupt)
    assert cli.main(["x"]) == 130
    assert capsys.readouterr().err == "boom: stopped\n"


def test_a_sigterm_ends_the_work_as_a_ctrl_c_does_with_143(monkeypatch, capsys, tmp_path):
    def work(arguments, program):
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        finally:
            (tmp_path / "tidied").touch()

    before = signal.signal(signal.SIGTERM, signal.SIG_DFL)
    monkeypatch.setattr(cli, "_run", work)
    try:
        assert cli.main(["x"]) == 143
    finally:
        signal.signal(signal.SIGTERM, before)
    assert capsys.readouterr().err == "boom: stopped\n"
    assert (tmp_path / "tidied").exists()


def test_an_import_that_makes_something_else_of_a_ctrl_c_ends_with_130(monkeypatch, capsys):
    def imported(arguments, program):
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            raise ImportError("IMPORTANT: PLEASE READ THIS\n" * 50) from None

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    monkeypatch.setattr(cli, "_run", imported)
    try:
        assert cli.main(["x"]) == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr().err == "boom: stopped\n"


def test_a_ctrl_c_while_the_entry_script_imports_ends_it_with_130_and_no_word():
    code = (
        "import builtins, os, runpy, signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "found = builtins.__import__\n"
        "def interrupted(name, *rest, **named):\n"
        "    if name == 'ctypes': os.kill(os.getpid(), signal.SIGINT)\n"
        "    return found(name, *rest, **named)\n"
        f"builtins.__import__ = interrupted; runpy.run_path({str(ROOT / 'boom')!r}, run_name='__main__')"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "")


@pytest.mark.parametrize("words", [["record", "x"], ["sim"], ["demo", str(BAG)]])
def test_missing_messages_are_one_line_that_says_how_to_have_them(words, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *rest: None if name == "boom_interfaces" else found(name, *rest)
    )
    assert cli.main(words) == 2
    error = capsys.readouterr().err
    assert error.startswith("boom: the messages boom_interfaces are not installed") and error.count("\n") == 1
    assert "pip install ./src/boom_interfaces" in error


@pytest.fixture
def things(tmp_path):
    """A bag and a machine file of somebody, and the folder that they are in."""
    shutil.copytree(ROOT / "bags" / "healthy" / "folded_fast", tmp_path / "mine")
    shutil.copy(ROOT / "src/boom_model/boom_model/machines/tz17.yaml", tmp_path / "crane.yaml")
    (tmp_path / "own").mkdir()
    shutil.copy(tmp_path / "crane.yaml", tmp_path / "own" / "machine.yaml")
    return tmp_path


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("validate mine --no-report --json mine/folded_fast.mcap", "--json folded_fast.mcap lies in the input mine"),
        ("validate mine --report mine/metadata.yaml", "--report metadata.yaml lies in the input mine"),
        ("check-machine crane.yaml --json crane.yaml", "--json crane.yaml is the input crane.yaml"),
        ("identify mine --machine crane.yaml --output ./crane.yaml", "--output crane.yaml is the input crane.yaml"),
        ("validate mine --json both --report ./both", "--json and --report are the same file"),
        ("diagnose mine --output mine", "--output mine is the input mine"),
        ("diagnose mine --output own", "--output own/machine.yaml: the file there is no earlier"),
        ("check-machine tz17 --json crane.yaml", "--json crane.yaml: the file there is no earlier result"),
        ("validate mine --no-report --json own/machine.yaml", "--json own/machine.yaml: the file there is no earlier"),
        ("validate mine --report crane.yaml", "--report crane.yaml: the file there is no earlier result"),
        (
            "new-machine --output new.yaml --manoeuvre crane.yaml",
            "--manoeuvre crane.yaml: the file there is no earlier",
        ),
        ("identify mine --output own/machine.yaml", "--output own/machine.yaml: the file there is no earlier result"),
        ("validate mine --report /proc/x.html", "--report /proc/x.html: may not be written"),
        ("fleet . --output fleet --publish crane.yaml/bag", "--publish crane.yaml/bag: there is no folder crane.yaml"),
    ],
)
def test_what_a_command_writes_never_replaces_what_it_reads_or_what_somebody_wrote(
    words, said, things, monkeypatch, capsys
):
    monkeypatch.chdir(things)
    before = {path: path.read_bytes() for path in things.rglob("*") if path.is_file()}
    assert cli.main(words.split()) == 2
    assert said in capsys.readouterr().err
    assert {path: path.read_bytes() for path in things.rglob("*") if path.is_file()} == before


def test_a_command_may_replace_its_own_earlier_results(things, monkeypatch, capsys):
    monkeypatch.chdir(things)
    for _ in range(2):
        assert cli.main(["validate", "mine", "--json", "numbers.json", "--report", "page.html"]) == 0
        assert cli.main(["export-fmu", "--output", "crane.fmu"]) == 0
    assert cli.main(["chain", "mine", "--no-report", "--json", "numbers.json"]) == 2
    assert "no earlier result of this kind" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("chain mine mine", "mine is given twice and would count twice"),
        ("chain mine link", "link is the same recording as mine and would count twice"),
        ("identify link mine/../mine", "mine is the same recording as link and would count twice"),
        ("new-machine --output new.yaml mine link", "link is the same recording as mine and would count twice"),
        ("diagnose mine link", "link is the same recording as mine and would count twice"),
        (
            "chain mine --joints outer_boom=inner_boom_joint",
            "outer_boom=inner_boom_joint: this is the boom's own joint",
        ),
        ("validate mine --joint q --joints slewing=q", "slewing=q: this is the boom's own joint"),
        ("chain mine --joints slewing=p,slewing=q", "each once"),
    ],
)
def test_one_recording_or_one_joint_cannot_stand_for_two(words, said, things, monkeypatch, capsys):
    monkeypatch.chdir(things)
    shutil.copytree("mine", "link", copy_function=os.link)
    assert cli.main(words.split()) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["diagnose", "bag", "--output", ""], "--output is empty"),
        (["diagnose", "bag", "--json="], "--json is empty"),
        (["fleet", "bags", "--output", ""], "--output is empty"),
        (["validate", "bag", "--report", ""], "--report is empty"),
        (["record", ""], "BAG is empty"),
        (["new-machine", "--output", "x" * 300], "File name too long: give another path"),
        (["validate", "bag", "--json", "x" * 300], "File name too long: give another path"),
        (["validate", "bag", "--json", "-"], "--json -: a file is due here"),
    ],
)
def test_a_path_that_no_file_can_have_is_refused_with_its_option(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(words) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1 and len(error) < 200
    assert not list(tmp_path.iterdir())


def test_a_negative_number_with_an_exponent_is_one(capsys):
    assert cli.main(["validate", "no_bag", "--q3", "-2.8e-1"]) == 2
    assert "no_bag" in capsys.readouterr().err


def test_a_closed_standard_output_is_no_fault_of_ours():
    command = f"{sys.executable} -m boom_bringup.cli check-machine tz17 >&-"
    done = subprocess.run(["/bin/sh", "-c", command], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("streams", ["2>&-", ">&- 2>&-", "<&- 2>&-", ">/dev/full 2>/dev/full"])
def test_wrong_input_keeps_its_status_where_nobody_can_be_told(streams):
    command = f"{sys.executable} {ROOT}/boom check-machine none {streams}"
    assert subprocess.run(["/bin/sh", "-c", command], timeout=60, check=False).returncode == 2


@pytest.mark.parametrize(
    ("module", "words", "status", "said"),
    [
        ("boom_bringup.cli", ("check-machine", "tz17"), 130, "boom: stopped\n"),
        (
            "boom_recording.recorder_node",
            ("--ros-args", "-p", "output:=never"),
            130,
            "boom: stopped before it began: nothing was recorded\n",
        ),
        ("boom_sim.simulation_node", (), 0, ""),
    ],
)
def test_a_ctrl_c_that_was_held_back_while_python_started_ends_it_without_a_traceback(
    module, words, status, said, tmp_path
):
    code = (
        "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL); "  # whatever started the tests may ignore it
        "signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}); os.kill(os.getpid(), signal.SIGINT); "
        "os.execv(sys.executable, [sys.executable, '-m', *sys.argv[1:]])"
    )
    command = [sys.executable, "-c", code, module, *words]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=60, check=False)
    assert (ended.returncode, ended.stderr) == (status, said)
    assert list(tmp_path.iterdir()) == []


def test_a_ctrl_c_within_a_text_that_is_executed_ends_with_130_and_not_by_the_signal(tmp_path: Path) -> None:
    (tmp_path / "stopped.py").write_text(
        "import sys\nfrom boom_bringup import cli\n"
        "cli._run = lambda *_: exec('raise KeyboardInterrupt')\nsys.exit(cli.main(['validate']))\n"
    )
    command = [
        sys.executable,
        "-m",
        "stopped",
    ]  # as the commands: Python looks at the signal at the end of modules alone
    ended = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=60, check=False)
    assert (ended.returncode, ended.stderr) == (130, "boom: stopped\n")


def test_a_ctrl_c_after_the_work_is_done_does_not_make_a_failure_of_it() -> None:
    code = (
        "import atexit, os, runpy, signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "atexit.register(os.kill, os.getpid(), signal.SIGINT)\n"
        "sys.argv[1:] = ['--version']; runpy.run_module('boom_bringup.cli', run_name='__main__')"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_steps_are_told_in_a_log_only_where_a_command_takes_longer_than_2_s(monkeypatch, capsys):
    now = iter([0.0, 1.9, 2.1])
    monkeypatch.setattr(showing, "QUIET", 2.0)
    monkeypatch.setattr(showing.time, "monotonic", lambda: next(now))
    with showing.progress(2) as step:
        step("reading a", 1)
        step("reading b", 1)
    assert capsys.readouterr().err == "boom: reading b\n"


def test_a_step_that_takes_long_is_told_again_in_a_log(monkeypatch, capsys):
    told, printed = threading.Event(), print

    def heard(*words, **how):
        printed(*words, **how)
        if "still" in words[0]:
            told.set()

    monkeypatch.setattr(showing, "SILENT", 0.01)
    monkeypatch.setattr(showing, "print", heard, raising=False)
    with showing.progress(1) as step:
        step("fitting effects", 0)
        assert told.wait(30.0)
    assert capsys.readouterr().err.startswith("boom: still working after 0 s: fitting effects\n")
    told.clear()
    with showing.progress(1):  # nothing has been said yet
        assert told.wait(30.0)
    assert capsys.readouterr().err.startswith("boom: still working after 0 s\n")


def test_a_report_of_a_recording_with_anybodys_name_is_named_after_its_folder(tmp_path, monkeypatch):
    """Folders of sixteen cranes, each with a ``recording``, had one report."""
    monkeypatch.chdir(tmp_path)
    assert outputs.default_report("validate", ["crane_7/recording"]).name == "validate-crane_7-recording.html"
    assert outputs.default_report("validate", ["crane_7/steps"]).name == "validate-steps.html"
    assert outputs.default_report("chain", ["crane_7/a"]).name == "chain-crane_7-a.html"


def test_a_report_of_a_recording_with_a_long_name_has_one_that_a_file_system_takes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    one, other = (outputs.default_report("validate", [120 * "ä" + end]) for end in "ab")
    assert one != other
    one.write_text("")
