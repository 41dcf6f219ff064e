"""What a run may replace in its output: what `boom fleet` wrote itself, of the same folders."""

import pytest

from boom_fleet.manifest import claim
from boom_fleet.store import Store, StoreError


def written(store, folders, machines):
    outputs = claim(store, folders, machines)
    for name in outputs.files:
        store.write(name, b"ours")
    outputs.settle()


def test_only_own_files_go_and_those_of_others_stay(tmp_path):
    store = Store(str(tmp_path))
    written(store, ["fleet"], ["north", "south"])
    store.write("recordings/summary.parquet", b"theirs")

    written(store, ["fleet"], ["north", "west"])

    assert store.names("recordings") == {"north.parquet", "west.parquet", "summary.parquet"}


@pytest.mark.parametrize("name", ["report.html", "recordings/north.parquet"])
def test_a_file_of_somebody_else_is_not_written_over(tmp_path, name):
    store = Store(str(tmp_path))
    store.write(name, b"theirs")
    with pytest.raises(StoreError, match=f"{name}: is not known to be of `boom fleet`"):
        claim(store, ["fleet"], ["north"])
    assert store.read(name) == b"theirs" and store.names("work") == set()


def test_the_results_of_another_fleet_are_not_lost_but_a_fleet_may_grow(tmp_path):
    store = Store(str(tmp_path))
    written(store, ["all/2025"], ["north"])
    with pytest.raises(StoreError, match=r"holds the results of .*/all/2025, which would be lost"):
        claim(store, ["all/20"], ["north"])
    written(store, ["all/2025", "s3://cranes/2026/"], ["north"])
    written(store, ["all", "s3://cranes/2026"], ["north"])
