"""A blind trial from seed to score: make and seal all cases, diagnose them blindly, open the seal, judge.

Below the trial's folder:

    state.json              seed, number of cases, machine, version, checksum of the answers
    blind/CASE/recording    input of the diagnosis, which works in blind/CASE and cannot open anything else of the trial
    blind/CASE/machine.yaml the owner's machine file, where the crane has one of its own
    blind/CASE/diagnosis    its answer
    sealed/CASE             answer, second recording, row of the score

Every file is written completely or not at all, so that a stopped trial can continue.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from boom_fleet.engine import Engine
from boom_input.whole import write_whole
from boom_node.children import die_with_parent
from boom_trials import __version__
from boom_trials.blind import judging
from boom_trials.blind.outcomes import Row
from boom_trials.blind.plants import MACHINE, PLANTS, CaseOfTrial
from concealed_plant.generator import ANSWER, RECORDING

DIAGNOSIS = "boom_bringup.cli"
"""The program on trial, the same that ./boom starts, in a separate process."""
ROUNDS = "rounds"
"""The default of ``./boom diagnose --engine``."""
PATIENCE = 600.0
"""s. A diagnosis that takes longer counts as failed."""
_STOPPED = tuple(code for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP) for code in (-n, 128 + n))
STATE = "state.json"
Progress = Callable[[str, int, int], None]
"""(current step, cases finished, all cases)"""


class TrialError(RuntimeError):
    """The folder holds another trial, or its answers were changed."""

    exit_status = 2


@dataclass(frozen=True)
class TrialState:
    """State of a trial; the SHA-256 of the answers is empty until all cases are made, seconds is the total time of all runs."""

    seed: int
    count: int
    machine: str
    version: str
    begun: str
    sha256: str = ""
    seconds: float = 0.0
    plant: str = "p"
    structures: str = "tz17"
    decides: str = ROUNDS

    @property
    def options(self) -> str:
        """What repeats the trial on the command line."""
        plant = "" if self.plant == "p" else f"--plant {self.plant} --structures {self.structures} "
        plant += "" if self.decides == ROUNDS else f"--engine {self.decides} "
        return f"{plant}--seed {self.seed} --cases {self.count}"

    @property
    def folder(self) -> str:
        """Where the command puts the trial by default."""
        return default_folder(self.plant, self.structures, self.seed, self.count, self.decides)


class Trial:
    """One trial in its folder.

    Raises:
        TrialError: the folder holds a trial with another seed, number of cases or plant.
    """

    def __init__(
        self, folder: Path, seed: int, count: int, machine: Path, plant: str = "p", structures: str = "tz17",
        decides: str = ROUNDS,
    ) -> None:  # fmt: skip
        self.folder = folder.resolve()
        self.blind, self.sealed = self.folder / "blind", self.folder / "sealed"
        self.machine = machine.resolve()
        self.plant = PLANTS[plant]
        self.specs: dict[str, CaseOfTrial] = {spec.name: spec for spec in self.plant.cases(seed, count, structures)}
        begun = time.strftime("%Y-%m-%d %H:%M")
        self.state = TrialState(seed, count, self.machine.name, __version__, begun, plant=plant, structures=structures,
                                decides=decides)  # fmt: skip
        known = stored(self.folder)
        if known is not None:
            if known.options != self.state.options:
                raise TrialError(
                    f"{folder}: holds a trial with {known.options}: go on with these, or give another --output"
                )
            self.state = known
        self.folder.mkdir(parents=True, exist_ok=True)
        self._keep(self.state)

    def prepare(self, engine: Engine, progress: Progress) -> str:
        """Make and seal all cases; returns the checksum of the answers.

        Raises:
            TrialError: the answers differ from those sealed before.
        """
        missing = [name for name in self.specs if not (self.sealed / name / ANSWER).exists()]
        self._each(engine, self.plant.make, missing, lambda name: (self.specs[name], self.machine, self.blind, self.sealed),
                   "making cases", progress)  # fmt: skip
        checksum = self._checksum()
        if self.state.sha256 and self.state.sha256 != checksum:
            raise TrialError(f"{self.folder}: the answers differ from the sealed ones: their checksum is {checksum}")
        self.state = replace(self.state, sha256=checksum)
        self._keep(self.state)
        return checksum

    def diagnose(self, engine: Engine, progress: Progress) -> None:
        """Run the diagnosis on every recording without an answer."""
        missing = [name for name in self.specs if not (self.blind / name / judging.OUTCOME).exists()]
        self._each(engine, diagnose, missing, lambda name: (self.blind / name, self.state.decides), "diagnosing",
                   progress)  # fmt: skip

    def score(self, engine: Engine, progress: Progress) -> list[Row]:
        """Open the answers; returns one row per case, in the order of the trial.

        Raises:
            TrialError: the answers have changed since they were sealed.
        """
        if self._checksum() != self.state.sha256:
            raise TrialError(f"{self.folder}: the answers were changed after they were sealed; this trial is void")
        documents: dict[str, dict[str, Any]] = {}
        self._each(engine, judging.judge, list(self.specs), lambda name: (name, self.blind, self.sealed, str(self.machine)),
                   "scoring", progress, documents.__setitem__)  # fmt: skip
        return [judging.row_of(documents[name]) for name in self.specs]

    def _each(
        self, engine: Engine, function: Callable[..., Any], names: list[str], arguments: Callable[[str], tuple[Any, ...]],
        title: str, progress: Progress, keep: Callable[[str, Any], None] | None = None,
    ) -> None:  # fmt: skip
        finished = len(self.specs) - len(names)
        progress(title, finished, len(self.specs))

        def done(name: str, result: Any) -> None:
            nonlocal finished
            finished += 1
            if keep is not None:
                keep(name, result)
            progress(title, finished, len(self.specs))

        if names:
            engine.each(function, names, arguments, done)

    def _checksum(self) -> str:
        """SHA-256 over all answers in the trial's order."""
        total = hashlib.sha256()
        for name in self.specs:
            total.update((self.sealed / name / ANSWER).read_bytes())
        return total.hexdigest()

    def answers(self) -> list[dict[str, Any]]:
        """The answers, in the order of the trial."""
        return [json.loads((self.sealed / name / ANSWER).read_text(encoding="utf-8")) for name in self.specs]

    def spent(self, seconds: float) -> None:
        """Add the time of a run, finished or not, unless it only rewrote the pages."""
        self.state = replace(self.state, seconds=self.state.seconds + seconds)
        self._keep(self.state)

    @property
    def finished(self) -> bool:
        """Whether every case has its diagnosis."""
        return all((self.blind / name / judging.OUTCOME).is_file() for name in self.specs)

    def _keep(self, state: TrialState) -> None:
        write_whole(self.folder / STATE, json.dumps(asdict(state), indent=1) + "\n")


def default_folder(plant: str, structures: str, seed: int, count: int, decides: str) -> str:
    """Where a trial lies unless another folder is given."""
    lot = "" if plant == "p" else f"{plant}-{structures}-"
    lot += "" if decides == ROUNDS else f"{decides}-"
    return f"output/prove-{lot}{seed}-{count}"


def stored(folder: Path) -> TrialState | None:
    """The state of the trial in a folder; None if there is none.

    Raises:
        TrialError: the file cannot be understood.
    """
    path = folder / STATE
    if not path.exists():
        return None
    try:
        return TrialState(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is not the state of a trial"
        raise TrialError(f"{path}: cannot be understood, {why}: remove the folder or give another --output") from None


def diagnose(case: Path, decides: str = ROUNDS) -> float:
    """Run the diagnosis on case/recording under the audit hook, in that folder; write case/outcome.json; return its duration [s].

    A failure of the diagnosis is an outcome, not an error: it counts as a wrong answer.

    Raises:
        InterruptedError: it was stopped from outside, so the case has to be repeated.
    """
    output = case / judging.DIAGNOSIS
    shutil.rmtree(output, ignore_errors=True)
    own = ["--machine", MACHINE] if (case / MACHINE).exists() else []
    command = [
        sys.executable,
        "-m",
        "boom_trials.blind.blindfold",
        DIAGNOSIS,
        "diagnose",
        RECORDING,
        "--output",
        judging.DIAGNOSIS,
        "--no-report",
        "--engine",
        decides,
        *own,
    ]
    begin, failure = time.monotonic(), ""
    with (case / "diagnose.log").open("wb") as log:
        try:
            done = subprocess.run(
                command,
                cwd=case,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                timeout=PATIENCE,
                check=False,
                start_new_session=True,  # Ctrl-C is for the trial; what it stops there is not to look like an answer
                preexec_fn=die_with_parent(os.getpid()),
            )
            if done.returncode in _STOPPED:
                raise InterruptedError(f"the diagnosis was stopped with status {done.returncode}")
            if done.returncode:
                failure = f"exit status {done.returncode}: {_last_line(case / 'diagnose.log')}"
        except subprocess.TimeoutExpired:
            failure = f"no answer within {PATIENCE:.0f} s"
    seconds = time.monotonic() - begin
    write_whole(case / judging.OUTCOME, json.dumps({"failure": failure, "seconds": seconds}))
    return seconds


def _last_line(path: Path) -> str:
    lines = path.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return lines[-1][:200] if lines else "it printed nothing"
