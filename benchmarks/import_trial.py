"""How often a proposed mapping is right, asked for, or wrong without a word, on tables in styles drawn at random.

Each case takes a recording, a language or house style, units, separators, signs, missing columns and columns that are no signal;
many words are in no list of `boom_import`. Right: all six signals have the original's values (the rate may be derived).

  ./boom python benchmarks/import_trial.py --cases 60 --seed 1
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
from foreign_recordings import ATMOSPHERE, DEG, data_of, table

from boom_import import assembly, conversion, reading
from boom_import.candidates import SIGNALS
from boom_import.errors import ImportingError

BAGS = ("bags/healthy/extended", "bags/healthy/folded_fast", "bags/healthy/extended_log", "bags/explained/payload_change_a",
        "../shared/recordings/strangers/stranger_1_a", "../shared/recordings/strangers/stranger_5_a")  # fmt: skip
# time, angle, rate, piston side, rod side, current that lifts, current that lowers
STYLES = {
    "english": "time|boom angle|boom angular rate|piston side pressure|rod side pressure|lift coil current|lower coil current",
    "english short": "t|boom_ang|boom_w|p_cap|p_ann|i_up|i_dn",
    "american": "Timestamp|Boom1 Incl|Boom1 Gyro|Base End Prs|Rod End Prs|Raise Cur|Lower Cur",
    "german": "Zeit|Hubwinkel|Drehrate|p Kolbenseite|p Stangenseite|I Heben|I Senken",
    "german short": "t|phi_HA|phiPkt_HA|pKS|pSS|I_heb|I_senk",
    "french": "Temps|Angle fleche|Vitesse angulaire|Pression fond|Pression tige|Courant montee|Courant descente",
    "spanish": "Tiempo|Angulo pluma|Velocidad angular|Presion piston|Presion vastago|Corriente subir|Corriente bajar",
    "italian": "Tempo|Angolo braccio|Velocita angolare|Pressione fondello|Pressione stelo|Corrente salita|Corrente discesa",
    "swedish": "Tid|Vinkel lyftarm|Vinkelhastighet|Tryck kolv|Tryck stang|Strom upp|Strom ner",
    "symbols": "t|q2|dq2|pA|pB|uA|uB",
    "channels": "Time|AI0|AI1|AI2|AI3|AI4|AI5",
    "nameless": "X|ch1|ch2|ch3|ch4|ch5|ch6",
}
PRESSURE = {"bar": 1e-5, "MPa": 1e-6, "Pa": 1.0, "kPa": 1e-3, "psi": 1 / 6894.757293}


def case(random, data, folder):
    """Write one table; returns its path, its style and the true values by signal."""
    style = str(random.choice(list(STYLES)))
    names = STYLES[style].split("|")
    degrees, milli = random.random() < 0.6, random.random() < 0.6
    unit = str(random.choice(list(PRESSURE), p=(0.5, 0.15, 0.15, 0.1, 0.1)))
    angle_sign, gyro_sign = (-1 if random.random() < p else 1 for p in (0.2, 0.15))
    absolute = random.random() < 0.15
    stated = absolute or random.random() < 0.75
    columns = _signals(data, names, (degrees, milli, unit, absolute), (angle_sign, gyro_sign))
    if random.random() < 0.25:
        del columns[2]
    head, rest = columns[:1], columns[1:]
    extras = _others(data, degrees, unit)
    rest += [extras[i] for i in random.permutation(len(extras))[: random.integers(0, 4)]]
    rest = [rest[i] for i in random.permutation(len(rest))]
    header = [f"{name} [{unit}]" if stated and unit else name for name, unit, _ in head + rest]
    separator, decimal = ((",", "."), (";", ","), ("\t", "."), (";", "."))[random.integers(4)]
    path = folder / "case.csv"
    table(path, header, [values for *_, values in head + rest], separator, decimal, digits=7)
    truth = dict(zip(SIGNALS, (data.q, data.w, data.ph, data.pb, data.ie, data.ir), strict=True))
    shown = f"{unit}{' abs' if absolute else ''}, sign {angle_sign:+d}{gyro_sign:+d}"
    return path, f"{style}, {shown}, units {'stated' if stated else 'not stated'}", truth


def _signals(data, names, form, signs):
    """(name, unit, values) of time and signals."""
    degrees, milli, unit, absolute = form
    turn, thousand = DEG if degrees else 1.0, 1e3 if milli else 1.0
    pressure = [(p + (ATMOSPHERE if absolute else 0.0)) * PRESSURE[unit] for p in (data.ph, data.pb)]
    current = "mA" if milli else "A"
    shown = unit + (" abs" if absolute else "")
    values = (
        ("ms" if milli else "s", data.t * thousand), ("deg" if degrees else "rad", signs[0] * data.q * turn),
        ("deg/s" if degrees else "rad/s", signs[0] * signs[1] * data.w * turn), (shown, pressure[0]), (shown, pressure[1]),
        (current, data.ie * thousand), (current, data.ir * thousand),
    )  # fmt: skip
    return [(name, *entry) for name, entry in zip(names, values, strict=True)]


def _others(data, degrees, unit):
    """Columns that are no signal."""
    stick = (0.8 + 0.3 * np.sin(0.1 * data.t)) * (DEG if degrees else 1.0)
    return [
        ("T oil", "degC", 40 + 0.01 * data.t), ("supply pressure", unit, data.supply * PRESSURE[unit]),
        ("counter", "", np.arange(len(data.t)) % 256.0), ("engine speed", "rpm", 1500 + 5 * np.sin(data.t)),
        ("stick angle", "deg" if degrees else "rad", stick),
    ]  # fmt: skip


def judge(path, truth):
    """Tell whether the proposal is right, asks or is wrong, and about what."""
    try:
        source = reading.read([path])
        proposal = assembly.propose(source)
        if proposal.mapping.open():
            return "asked", "; ".join(f"{k}: {v[:60]}" for k, v in proposal.questions.items())
        recording = conversion.convert("case", source, proposal.mapping)
    except ImportingError as error:
        return "asked", str(error)[-80:]
    wrong = []
    for signal, values in truth.items():
        found = recording.signals.get(signal)
        derived = signal == "rate" and proposal.mapping.signals["rate"] == "derivative of angle"
        off = np.inf if found is None or len(found.values) != len(values) else np.abs(found.values - values)
        if np.quantile(off, 0.95) > (0.2 if derived else 0.01) * max(np.ptp(values), 1e-9):
            wrong.append(f"{signal} = {proposal.mapping.signals[signal]}")
        elif signal.endswith("pressure") and np.median(off) > 2e4:
            wrong.append(f"{signal}: gauge or absolute")
    return ("wrong", "; ".join(wrong)) if wrong else ("right", "")


def main():
    """Run the cases and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    random = np.random.default_rng(args.seed)
    bags = [data_of(bag) for bag in BAGS if Path(bag).exists()]
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for number in range(args.cases):
            which = int(random.integers(len(bags)))
            path, what, truth = case(random, bags[which], Path(folder))
            outcome, why = judge(path, truth)
            counts[outcome] += 1
            if outcome != "right":
                print(f"{number:3d} {outcome}: {Path(BAGS[which]).name}, {what}: {why}")
    print(", ".join(f"{name} {counts[name]}" for name in ("right", "asked", "wrong")))


if __name__ == "__main__":
    main()
