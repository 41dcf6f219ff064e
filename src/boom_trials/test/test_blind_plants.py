"""The plant of a trial is a choice: what Q's cases consist of in the folder of a trial, and what counts as right there."""

import json
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import pytest

from boom_bringup import cli
from boom_model.catalogue import EFFECTS
from boom_model.machine_file import load_machine
from boom_recording.loading import load
from boom_trials.blind import judging, trial
from boom_trials.blind.outcomes import Truth
from boom_trials.blind.plants import MACHINE, PLANTS
from boom_trials.blind.trial import Trial, TrialError
from unseen_plant import generator
from unseen_plant.lots import Lot

MACHINE_FILE = Path(str(files("boom_model").joinpath("machines", "tz17.yaml")))
LOTS = [Lot("aaa", (9, 1), "healthy"), Lot("bbb", (9, 2), "parameters", anything=True)]


class OneByOne:
    def each(self, function, cases, arguments, done):
        for case in cases:
            done(case, function(*arguments(case)))


def quiet(*_):
    pass


@pytest.fixture(scope="module")
def short():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generator, "DURATION", 10.0)
        patch.setitem(PLANTS, "q", replace(PLANTS["q"], cases=lambda seed, count, structures: LOTS))
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory, short):
    prepared = Trial(tmp_path_factory.mktemp("trial"), 9, 2, MACHINE_FILE, "q", "any")
    prepared.prepare(OneByOne(), quiet)
    return prepared


def test_a_crane_of_its_own_structure_brings_its_owners_machine_file_and_the_answers_stay_sealed(made):
    assert sorted(p.name for p in (made.blind / "aaa").iterdir()) == ["recording"]
    assert sorted(p.name for p in (made.blind / "bbb").iterdir()) == [MACHINE, "recording"]
    believed = load_machine(str(made.blind / "bbb" / MACHINE))
    recording = load(made.blind / "bbb" / "recording")
    assert recording.configuration.machine == believed.name
    assert set(recording.signals) >= {
        "angle",
        "rate",
        "hose_pressure",
        "rod_pressure",
        "retract_current",
        "extend_current",
    }
    shown = b"".join(p.read_bytes() for p in made.blind.rglob("*") if p.is_file())
    assert b"standard deviations" not in shown and b'"kind"' not in shown
    assert [a["kind"] for a in made.answers()] == ["healthy", "parameters"]


def test_each_case_is_diagnosed_and_judged_with_its_owners_machine(made, monkeypatch):
    asked = {}

    def run(command, **options):
        asked[options["cwd"].name] = command
        raise trial.subprocess.TimeoutExpired(command, 1.0)

    with monkeypatch.context() as patch:  # the judge compiles models with programs of its own
        patch.setattr(trial.subprocess, "run", run)
        made.diagnose(OneByOne(), quiet)
    assert "--machine" not in asked["aaa"] and asked["bbb"][-2:] == ["--machine", MACHINE]
    healthy, wrong = made.score(OneByOne(), quiet)
    assert "no answer within" in healthy.said.failure
    judged = judging._errors(made.sealed / "bbb" / "hold_out", load_machine(str(made.blind / "bbb" / MACHINE)))
    assert list(wrong.nominal) == [float("inf") if e is None else e for e in judged]
    assert all(o < 0.5 for o in wrong.truth.oracle)


def test_a_trial_of_another_plant_is_not_gone_on_with(made):
    with pytest.raises(TrialError, match="--plant q --structures any --seed 9 --cases 2"):
        Trial(made.folder, 9, 2, MACHINE_FILE)


def test_an_effect_that_the_catalogue_has_not_is_rightly_called_unknown():
    effect = {
        "known": True, "subsystems": ["oil"], "strength": 1.0, "size": 1.0, "unit": "-", "parameters": {}, "onset_s": None,
        "detectable": 1.0,
    }  # fmt: skip
    answer = {"name": "x", "kind": "effect", "wrong": {}, "oracle": [0.1] * 4}
    names = ("payload", "an effect of tomorrow")
    truth = Truth.from_document(json.loads(json.dumps({**answer, "effects": [{**effect, "effect": n} for n in names]})))
    assert [e.known for e in truth.effects] == [True, False]


def test_every_effect_of_the_catalogue_is_concealed_by_a_plant_and_every_form_is_told():
    concealed = set()
    for plant in PLANTS.values():
        forms = plant.forms()
        known = {name for name, form in forms.items() if form.known}
        assert known <= set(EFFECTS)
        concealed |= known
        assert all(form.text and form.unit and len(form.text) < 400 for form in forms.values())
    not_concealed = {
        "load_holding_valve_lag",
        "load_holding_valve_setting",
        "vented_neutral",
        "spool_lag",
        "stroke_limit",
        "transducer_lag",
    }  # of files with a load-holding valve, which no plant has; newer than the plants
    foreign = {name for name, effect in EFFECTS.items() if effect.foreign}  # concealed as physics of no catalogue
    assert concealed == set(EFFECTS) - not_concealed - foreign


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--structures", "any"], "--structures any: plant p has only tz17"),
        (["--cases-only", "x", "--json", "f.json"], "--cases-only ends before there is a score"),
    ],
)
def test_options_that_do_not_go_together_end_in_one_line(options, said, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["prove", *options]) == 2
    told = capsys.readouterr().err
    assert said in told and told.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_cases_alone_can_be_made_and_looked_at(short, capsys, monkeypatch, tmp_path):
    monkeypatch.setitem(PLANTS, "q", replace(PLANTS["q"], cases=lambda seed, count, structures: []))
    assert (
        cli.main(["prove", "--plant", "q", "--seed", "1", "--cases", "1", "--cases-only", str(tmp_path / "cases")]) == 0
    )
    assert (tmp_path / "cases" / trial.STATE).exists()
    assert "answers are sealed" in capsys.readouterr().out
