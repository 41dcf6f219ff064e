"""A trial in its folder: what is shown, what is sealed, going on after a stop, and the score of answers made by hand."""

import json
import signal
import subprocess
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import pytest

from boom_trials.blind import judging, trial
from boom_trials.blind.plants import PLANTS
from boom_trials.blind.trial import Trial, TrialError
from concealed_plant import generator
from concealed_plant.cases import CaseSpec

SPECS = [CaseSpec("aaa", (9, 1), "healthy"), CaseSpec("bbb", (9, 2), "effect", (("payload", 3.0),))]


class Here:
    """The cases one after the other in this process."""

    def each(self, function, cases, arguments, done):
        for case in cases:
            done(case, function(*arguments(case)))


def quiet(*_):
    pass


@pytest.fixture(scope="module")
def machine():
    return Path(str(files("boom_model").joinpath("machines", "tz17.yaml")))


@pytest.fixture(scope="module")
def short():
    """Two cases of 12 s."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generator, "DURATION", 12.0)
        short = replace(PLANTS["p"], cases=lambda seed, count, structures: SPECS)
        patch.setitem(PLANTS, "p", short)
        yield


@pytest.fixture(scope="module")
def sealed(tmp_path_factory, machine, short):
    """A trial of these cases, made and sealed."""
    made = Trial(tmp_path_factory.mktemp("trial"), 9, 2, machine)
    made.prepare(Here(), quiet)
    return made


def again(sealed, machine):
    return Trial(sealed.folder, 9, 2, machine)


def answered(sealed):
    """Hand-made outcomes: the first has no answer, the second one names the load."""
    finding = {
        "effect": "payload", "subsystem": "load", "confidence": 0.9, "alternatives": [],
        "parameters": {"mass": {"value": 100.0, "unit": "kg", "interval_90": [1.0, 3000.0]}},
    }  # fmt: skip
    (sealed.blind / "aaa" / judging.OUTCOME).write_text('{"failure": "exit status 1: full disk", "seconds": 2.0}')
    (sealed.blind / "bbb" / judging.OUTCOME).write_text('{"failure": "", "seconds": 30.0}')
    folder = sealed.blind / "bbb" / judging.DIAGNOSIS
    folder.mkdir(exist_ok=True)
    (folder / "diagnosis.json").write_text(json.dumps({"verdict": "identified", "findings": [finding]}))


def test_the_time_of_all_runs_is_kept_and_drawing_the_pages_anew_is_none(sealed, machine):
    assert not sealed.finished
    before = sealed.state.seconds
    sealed.spent(60.0)
    again(sealed, machine).spent(30.0)
    assert again(sealed, machine).state.seconds == pytest.approx(before + 90.0)


def test_the_blind_side_holds_the_recording_and_nothing_else(sealed):
    for spec in SPECS:
        assert [p.name for p in (sealed.blind / spec.name).iterdir()] == ["recording"]
    text = b"".join(p.read_bytes() for p in sealed.blind.rglob("*") if p.is_file())
    assert b"payload" not in text and b"strength" not in text


def test_the_same_case_is_the_same_answer(sealed, machine, tmp_path, short):
    made = generator.make_case(SPECS[1], machine, tmp_path / "blind", tmp_path / "sealed")
    assert made.read_bytes() == (sealed.sealed / "bbb" / "answer.json").read_bytes()


def test_a_trial_that_was_stopped_goes_on_where_it_was(sealed, machine):
    answers = [sealed.sealed / s.name / "answer.json" for s in SPECS]
    before = [p.stat().st_mtime_ns for p in answers]
    other = again(sealed, machine)
    assert other.prepare(Here(), quiet) == sealed.state.sha256
    assert [p.stat().st_mtime_ns for p in answers] == before


def test_a_folder_of_another_trial_is_refused(sealed, machine):
    with pytest.raises(TrialError, match="--seed 9 --cases 2"):
        Trial(sealed.folder, 10, 2, machine)


def test_the_score_of_answers_made_by_hand(sealed, machine):
    answered(sealed)
    healthy, loaded = again(sealed, machine).score(Here(), quiet)
    assert healthy.said.failure == "exit status 1: full disk"
    assert not loaded.said.failure and loaded.right_first
    assert loaded.gap_closed == 0.0, "it wrote no machine: the nominal one is judged"
    assert loaded.truth.effects[0].strength == 3.0
    assert all(0 < o < n < 10 for o, n in zip(loaded.truth.oracle, loaded.nominal, strict=True))
    assert max(healthy.truth.oracle) < 0.2


def test_answers_that_were_changed_are_noticed(sealed, machine):
    path = sealed.sealed / "aaa" / "answer.json"
    whole = path.read_bytes()
    path.write_bytes(whole + b" ")
    try:
        with pytest.raises(TrialError, match="changed after they were sealed"):
            again(sealed, machine).score(Here(), quiet)
    finally:
        path.write_bytes(whole)


def test_a_diagnosis_that_fails_is_an_outcome_and_one_that_was_stopped_is_repeated(tmp_path, monkeypatch):
    def ended(status):
        def run(command, **options):
            assert options["cwd"] == tmp_path
            assert all("sealed" not in word for word in command)
            options["stdout"].write(b"boom: it is full\n")
            options["stdout"].flush()
            return subprocess.CompletedProcess(command, status)

        return run

    monkeypatch.setattr(trial.subprocess, "run", ended(2))
    trial.diagnose(tmp_path)
    assert json.loads((tmp_path / judging.OUTCOME).read_text())["failure"] == "exit status 2: boom: it is full"
    (tmp_path / judging.OUTCOME).unlink()
    monkeypatch.setattr(trial.subprocess, "run", ended(-signal.SIGINT))
    with pytest.raises(InterruptedError):
        trial.diagnose(tmp_path)
    assert not (tmp_path / judging.OUTCOME).exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--cases", "0"], "--cases 0: give a number from 1 to 10000"),
        (["--workers", "0"], "--workers 0: give at least 1"),
        (["--seed", "-1"], "--seed -1: give a number"),
        (["--cases", "999999999999"], "--cases 999999999999: give a number from 1 to 10000"),
        (["--machine", "nobody"], "--machine nobody: no shipped machine"),
        (["--machine", "triangle_direct"], "kinematics.type: triangle"),
        (["--json", "nowhere/f.json"], "there is no folder nowhere"),
    ],
)
def test_wrong_options_end_in_one_line(options, said, capsys, monkeypatch, tmp_path):
    from boom_bringup import cli

    monkeypatch.chdir(tmp_path)
    assert cli.main(["prove", *options]) == 2
    told = capsys.readouterr().err
    assert said in told and told.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_pair_of_which_one_is_not_seen_beside_the_other_is_none(machine, tmp_path, short, monkeypatch):
    pair = CaseSpec("ccc", (9, 7), "pair", (("payload", 3.0), ("rate_scale", 3.0)))
    asked = []
    monkeypatch.setattr(generator, "ATTEMPTS", 6)
    monkeypatch.setattr(generator.Detectability, "beside", lambda *given: asked.append(given) or 0.0)
    with pytest.raises(generator.GenerationError):
        generator.make_case(pair, machine, tmp_path / "blind", tmp_path / "sealed")
    assert asked, "an attempt came so far that the pair was looked at"


def test_a_pair_that_no_crane_shows_gives_way_to_another_one_and_always_to_the_same(machine, tmp_path, monkeypatch):
    spec = CaseSpec("ddd", (9, 8), "pair", (("end_cushioning", 3.0), ("spring_rate", 3.0)))
    tried = []

    def attempt(of, *given):
        tried.append(of.effects)
        raise generator.TooFaintError("not seen")

    monkeypatch.setattr(generator, "_attempt", attempt)
    for _ in range(2):
        with pytest.raises(generator.GenerationError):
            generator.make_case(spec, machine, tmp_path / "blind", tmp_path / "sealed")
    first, again_ = tried[: generator.ATTEMPTS], tried[generator.ATTEMPTS :]
    assert first == again_
    assert len(set(first)) == generator.ATTEMPTS // generator.PAIR_ATTEMPTS
    assert set(first[: generator.PAIR_ATTEMPTS]) == {spec.effects}
