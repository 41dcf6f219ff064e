"""A diagnosis in a blind trial can open its own case and nothing else of the trial."""

import subprocess
import sys

import pytest

PROGRAM = """
import os, sys
from boom_trials.blind.blindfold import put_on
put_on(os.getcwd())
{action}
print("done")
"""


@pytest.fixture
def trial(tmp_path):
    for name in ("one", "two"):
        (tmp_path / "blind" / name).mkdir(parents=True)
        (tmp_path / "sealed" / name).mkdir(parents=True)
        (tmp_path / "sealed" / name / "answer.json").write_text("{}")
    (tmp_path / "blind" / "one" / "mine").write_text("mine")
    (tmp_path / "state.json").write_text("{}")
    return tmp_path


def attempt(trial, action):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(action=action)],
        cwd=trial / "blind" / "one", capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    return done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "action",
    [
        "open('../../sealed/one/answer.json').read()",
        "os.listdir('../../sealed')",
        "list(os.scandir('../two'))",
        "open('../../state.json').read()",
        "os.rename('mine', '../two/mine')",
        "os.symlink('../../sealed/one/answer.json', 'link'); open('link').read()",
        "import subprocess; subprocess.run(['cat', '../../sealed/one/answer.json'], check=True)",
        "import shutil; shutil.copyfile('../../sealed/one/answer.json', 'copy')",
    ],
)
def test_what_is_sealed_cannot_be_reached(trial, action):
    done, said = attempt(trial, action)
    assert not done
    assert "is sealed: the trial is blind" in said


def test_a_forked_process_wears_the_blindfold_too(trial):
    action = (
        "child = os.fork()\n"
        "if child == 0:\n"
        "    try:\n        open('../../sealed/one/answer.json')\n    except PermissionError:\n        os._exit(7)\n"
        "    os._exit(0)\n"
        "assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7"
    )
    done, said = attempt(trial, action)
    assert done, said


def test_the_own_case_and_the_rest_of_the_computer_stay_open(trial, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "file"
    elsewhere.write_text("x")
    done, said = attempt(
        trial, f"open('mine').read(); open('new', 'w').write('x'); os.listdir('.'); open({str(elsewhere)!r}).read()"
    )
    assert done, said
