"""A small blind trial with a fresh seed, through the command as anybody runs it. It fails below a floor.

Few cases say little about shares: the floor is what a diagnosis that works does not miss in thousands of such trials, one that
is broken does. The shares themselves are in docs/proof.md.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from boom_bringup.proof.scoring import CONFIDENT

CASES = 4
MOST_SURE_AND_WRONG = 2


@pytest.mark.process
def test_a_fresh_blind_trial_stays_above_the_floor(tmp_path):
    score = tmp_path / "score.json"
    command = [sys.executable, "-m", "boom_bringup.cli", "prove", "--cases", str(CASES), "--workers", "2"]
    done = subprocess.run(
        [*command, "--output", str(tmp_path / "trial"), "--json", str(score)],
        capture_output=True, text=True, timeout=900, check=False, env=dict(os.environ),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    document = json.loads(score.read_text())
    told = f"repeat it with ./boom prove --seed {document['seed']} --cases {CASES}"
    assert document["sha256"] in done.stdout.replace("\n", "")
    assert len(document["cases"]) == CASES
    logs = {p.parent.name: p.read_text()[-300:] for p in (tmp_path / "trial").glob("blind/*/diagnose.log")}
    failed = [logs[c["case"]] for c in document["cases"] if c["said"] == "failed"]
    assert not failed, f"{told}: no answer: {failed}"
    sure = [c for c in document["cases"] if (c["confidence"] or 0.0) >= CONFIDENT and not c["right_first"]]
    assert len(sure) <= MOST_SURE_AND_WRONG, f"{told}: sure and wrong: {sure}"
    worse = [c for c in document["cases"] if c["gap_closed"] is not None and c["gap_closed"] < -0.5]
    assert len(worse) <= 1, f"{told}: its model is worse than the nominal one on a recording it has not seen: {worse}"
    for name in ("proof.md", "report.html"):
        assert str(document["seed"]) in Path(tmp_path / "trial" / name).read_text()
