"""The simulated fleet of the benchmark: made once, by several processes, whole or not at all."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "benchmarks"))

from fleet_cranes import FATES, Fleet, make

ROOT = Path(__file__).resolve().parents[3]
FLEET = Fleet(1, 3, 6.0, FATES[:1], seed=1)
MACHINE = ROOT / "src/boom_model/boom_model/machines/tz17.yaml"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("benchmark") / "bags"
    said = []
    make(FLEET, MACHINE, folder, 1, said.append)
    assert said[0] == "0 of 3 recordings are there" and said[-1].endswith("3 of 3")
    return folder


def content(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*.mcap")}


def test_what_is_missing_is_made_again_to_the_same_bytes_and_the_rest_is_left(made):
    before = content(made)
    lost = sorted(made.glob("*/*"))[1]
    for path in lost.iterdir():
        path.unlink()
    lost.rmdir()
    half = made.with_suffix(".unfinished") / "0-1" / lost.name
    half.mkdir(parents=True)
    (half / "half.mcap").write_bytes(b"what a killed process left")
    said = []

    make(FLEET, MACHINE, made, 1, said.append)

    assert said[0] == "2 of 3 recordings are there" and len(said) == 2
    assert content(made) == before and len(before) == 3
    assert not made.with_suffix(".unfinished").exists()


def test_the_recordings_of_another_fleet_are_not_mixed_with_it(made):
    with pytest.raises(ValueError, match="another fleet"):
        make(replace(FLEET, seconds=60.0), MACHINE, made, 1, print)
