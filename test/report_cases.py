"""Diagnosis results for the tests of report and table: a plant with an effect against the nominal one, all simulated.

Nothing in them is invented: series are free runs, errors are computed from them, and the unknown inputs are the difference
between the two models' derivatives along the run.
"""

import dataclasses
import functools

import numpy as np
from diagnosis_samples import PERIOD, tz17

from boom_diagnosis.document import (
    SUBSYSTEMS,
    Alternative,
    BagResult,
    ChannelFit,
    DiagnosisResult,
    Document,
    EquationEvidence,
    Estimate,
    Experiment,
    Finding,
    Fit,
    LadderStep,
    LearnedCurve,
    RankingRow,
    Regime,
)
from boom_input.channels import BY_NAME
from boom_model.machine import Machine
from boom_model.plant import Plant
from boom_model.sensors import OUTPUTS
from boom_recording.recording import Event

TAU = 0.09
EXTENDED = (0.28, 2.2)
RAMP = 30  # samples in which an operator moves the joystick
DURATION = 30.0


def currents(time: np.ndarray, seed: int) -> np.ndarray:
    """Currents (n, 2) [A] of an operator: moves of 1.2 s with pauses."""
    rng = np.random.default_rng(seed)
    result, at, up, height = np.zeros((len(time), 2)), 1.2, True, 0.5
    while at < time[-1] - 2.0:
        moving = (time >= at) & (time < at + 1.2)
        height = rng.uniform(0.42, 0.55) if up else height  # down as far as up: the boom stays in its stroke
        result[moving, 1 if up else 0] = height
        at, up = at + rng.uniform(2.0, 2.8), not up
    ramp = np.ones(RAMP) / RAMP
    return np.column_stack([np.convolve(result[:, k], ramp)[: len(time)] for k in range(2)])


@functools.cache
def runs(seed: int) -> dict[str, np.ndarray]:
    """Measured outputs (n, 4), free runs of the nominal and the explained model, and the unknown head flow [m^3/s]."""
    time = np.arange(round(DURATION / PERIOD)) * PERIOD
    given = currents(time, seed)
    machines = {"nominal": tz17(), "explained": with_lag(TAU * 1.02), "truth": with_lag(TAU)}
    result: dict[str, np.ndarray] = {"time": time}
    for name, machine in machines.items():
        plant = Plant(machine, machine.pose(*EXTENDED))
        run = plant.run(time, given, time, plant.equilibrium(0.5), tolerance=1e-6)
        result[name] = run.outputs
        if name == "truth":
            flow = plant.auxiliary(run.states, given)["head_flow"]
            nominal = Plant(tz17(), plant.pose)
            states = run.states[:, [run.state_names.index(n) for n in nominal.state_names]]
            result["unknown flow"] = flow - nominal.auxiliary(states, given)["head_flow"]
    result["measured"] = tz17().sensor_noise().outputs(result["truth"], np.random.default_rng(seed))
    return result


def healthy(seed: int) -> np.ndarray:
    """What the sensors of a machine that hides nothing show (n, 4)."""
    return tz17().sensor_noise().outputs(runs(seed)["nominal"], np.random.default_rng(seed))


def with_lag(tau: float) -> Machine:
    return tz17().with_effects({"hose_burst_valve_lag": {"tau": tau}})


def noise() -> tuple[float, float, float, float]:
    n = tz17().sensor_noise()
    pressure = float(np.hypot(n.pressure_sigma, n.pressure_quantum / 12**0.5))
    return n.angle_quantum / 12**0.5, n.rate_sigma, pressure, pressure


def errors(seed: int, stage: str) -> tuple[float, ...]:
    """Normalised rms errors of a stage, per channel."""
    r = runs(seed)
    rms = np.sqrt(np.mean((r[stage] - r["measured"]) ** 2, axis=0))
    return tuple(float(v) for v in rms / np.std(r["measured"], axis=0))


def bag(name: str, seed: int, *, held_out: bool, events: tuple[Event, ...] = ()) -> BagResult:
    r = runs(seed)
    stages = ("nominal", "parameters_only", "explained")
    series = {"nominal": r["nominal"], "parameters_only": r["nominal"], "explained": r["explained"]}
    channels = {
        c: ChannelFit(
            c, BY_NAME[c].unit, r["time"], r["measured"][:, i], np.ones(len(r["time"]), bool), noise()[i],
            {stage: series[stage][:, i] for stage in stages},
        )
        for i, c in enumerate(OUTPUTS)
    }  # fmt: skip
    off = np.abs(r["nominal"][:, 3] - r["measured"][:, 3]) > 6 * noise()[3]
    edges = np.flatnonzero(np.diff(np.concatenate(([0], off.astype(int), [0]))))
    windows = [
        (float(a * PERIOD), float(b * PERIOD)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 5
    ]
    flow = r["unknown flow"]
    equations = {"head_flow": flow / max(np.std(flow), 1e-12), "torque": np.zeros(len(flow))}
    return BagResult(
        name, held_out, None, DURATION, events, channels, tuple(windows), r["time"], equations, direction(seed)
    )  # fmt: skip


def direction(seed: int) -> np.ndarray:
    rate = runs(seed)["truth"][:, 1]
    return np.where(rate > 0.01, 1, np.where(rate < -0.01, 2, 0)).astype(np.int64)


def regimes() -> tuple[Regime, ...]:
    r, which = runs(1), direction(1)
    rows = []
    for k, (label, kind) in enumerate((("at rest", "rest"), ("lifting", "extending"), ("lowering", "retracting"))):
        chosen = which == k

        def ratio(stage: str, i: int, chosen: np.ndarray = chosen) -> float:
            step = np.diff(r[stage][:, i] - r["measured"][:, i])[chosen[1:]]
            return float(np.mean(step**2) / (2 * noise()[i] ** 2))

        before = {c: ratio("nominal", i) for i, c in enumerate(OUTPUTS)}
        after = {c: ratio("explained", i) for i, c in enumerate(OUTPUTS)}
        rows.append(Regime(label, kind, "", float(chosen.sum() * PERIOD), before, after))
    return tuple(rows)


def lag_finding(confidence: float = 0.97, **changes: object) -> Finding:
    finding = Finding(
        "hose_burst_valve_lag", "hose_burst_valve", "5.39f", confidence,
        {"tau": Estimate(TAU * 1.02, "s", (0.0862, 0.0969))}, "retracting, first 0.3 s of fast lowering",
        tuple(bag("a", 1, held_out=False).windows[:3]), (Alternative("hose_burst_valve_setting", 0.02),),
        "The rod pressure overshoots when lowering starts, and only then.",
    )  # fmt: skip
    return dataclasses.replace(finding, **changes)


@functools.cache
def identified() -> DiagnosisResult:
    """The poppet of the hose burst valve lags by 90 ms: found on recording a, proved on b."""
    fit = Fit(
        {s: errors(1, s.replace("parameters_only", "nominal")) for s in ("nominal", "parameters_only", "explained")},
        {s: errors(2, s.replace("parameters_only", "nominal")) for s in ("nominal", "parameters_only", "explained")},
        errors(2, "truth"), ("lag_b",),
    )  # fmt: skip
    tau = {"tau": lag_finding().parameters["tau"]}
    document = Document(
        "identified", (lag_finding(),), {**dict.fromkeys(SUBSYSTEMS, 0.005), "hose_burst_valve": 0.97, "main_valve": 0.08},
        fit, "Lower fast twice from the upper end: this separates the lag from another setting.", 7, {"lag_a": "0" * 64}, "0.1.0",
        (
            RankingRow("hose burst valve lag", "hose_burst_valve_lag", "effect", "hose_burst_valve", 0.97, 812.0, 640.0, tau),
            RankingRow("parameters only", None, "parameters", "", 0.01, 0.0, 0.0, {}),
            RankingRow("sensors", None, "sensors", "sensors", 0.01, 3.0, -2.0, {}, inside=False, note="bias of 9 bar"),
            RankingRow("unknown", None, "unknown", "", 0.01, 5.0, -8.0, {}),
        ),
    )  # fmt: skip
    time = np.arange(0.0, 10.0, PERIOD)
    return DiagnosisResult(
        document, tz17(), with_lag(TAU * 1.02),
        (bag("lag_a", 1, held_out=False), bag("lag_b", 2, held_out=True)), regimes(),
        (
            EquationEvidence("head_flow", "flow through the hose burst valve", "5.39f", ("hose_burst_valve", "cylinder"), 0.9, 0.8),
            EquationEvidence("torque", "equation of motion", "5.39b", ("load", "structure", "friction"), 0.1, 0.2),
        ),
        "Both ways point to the flow through the hose burst valve.",
        (
            LadderStep("nominal", fit.training["nominal"], fit.held_out["nominal"]),
            LadderStep("parameters only", fit.training["parameters_only"], fit.held_out["parameters_only"]),
            LadderStep("+ hose burst valve lag", fit.training["explained"], fit.held_out["explained"]),
        ),
        (), "", {"friction.tau_C_pos": Estimate(4100.0, "N m", (4000.0, 4200.0))},
        Experiment(
            "Lower fast twice.", time, currents(time, 3), np.zeros((len(time), 4)),
            (("hose_burst_valve_lag", "hose_burst_valve_setting", 1.2, 8.4),),
        ),
        ("lag_a does not state its load: 0 kg is assumed",), "boom diagnose lag_a --hold-out lag_b",
    )  # fmt: skip


def unknown_physics() -> DiagnosisResult:
    """The same mismatch as if the catalogue had no name for it: the head flow over its pressure drop, learnt."""
    r = runs(1)
    x = np.linspace(-5e5, 5e5, 60)
    drop = r["truth"][:, 2] - r["nominal"][:, 2]
    slope = float(np.polyfit(drop, r["unknown flow"], 1)[0])
    spread = float(np.std(r["unknown flow"] - slope * drop))
    curve = LearnedCurve(
        "5.39f", f"q_a += {slope:.3g} m^3/s/Pa (p_h - p_a)", "Dissipative and one-sided: like an orifice that opens late.",
        "pressure drop p_h - p_a", "Pa", "m^3/s", x, slope * x, slope * x - spread, slope * x + spread,
    )  # fmt: skip
    finding = lag_finding(0.8, effect=None, parameters={}, alternatives=())
    return changed(
        "unknown_physics", (finding,), learned=(curve,), remaining="The rod pressure's first 50 ms of each start."
    )


def without_finding(verdict: str) -> DiagnosisResult:
    """No finding, on a recording of a machine that hides nothing."""
    measured = healthy(1)
    error = np.sqrt(np.mean((runs(1)["nominal"] - measured) ** 2, axis=0)) / np.std(measured, axis=0)
    floor = tuple(float(v) for v in error)
    seen = bag("healthy", 1, held_out=False)
    channels = {
        c: dataclasses.replace(ch, measured=measured[:, i], stages={"nominal": ch.stages["nominal"]})
        for i, (c, ch) in enumerate(seen.channels.items())
    }
    result = changed(verdict, ())
    document = dataclasses.replace(
        result.document,
        fit=Fit({"nominal": floor}, {"nominal": floor}, floor, ("healthy",)),
        subsystems={},
        next_experiment="",
        ranking=(),
    )
    return dataclasses.replace(
        result, document=document, explained=tz17(), ladder=(), equations=(), regimes=(), agreement="",
        bags=(dataclasses.replace(seen, channels=channels, windows=(), equations={}),), experiment=None,
        tolerances_used={}, notes=(), remaining="",
    )  # fmt: skip


def changed(verdict: str, findings: tuple[Finding, ...], **changes: object) -> DiagnosisResult:
    document = dataclasses.replace(identified().document, verdict=verdict, findings=findings)
    return dataclasses.replace(identified(), document=document, **changes)
