"""Identification of the pilot valves from oscilloscope bags, ch. 5.1: static curve, linear part, validation, both valves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray

from boom_identification import signals
from boom_identification.estimate import Identified, NotDetermined, interval
from boom_identification.pilot_dynamics import Arx, FirstOrder, Pair, arx, first_order_arx, output_error
from boom_identification.pilot_joint import joint_fit
from boom_identification.pilot_static import Averaged, AveragedTrace, StaticCurve, averaged, fit_curve
from boom_recording.oscilloscope import VALVES, OscilloscopeTrace

Array = NDArray[np.float64]
Progress = Callable[[str], None]

ORDERS = ((1, 0), (1, 1), (2, 1), (2, 2))
"""(n, m) that are compared; the thesis also compared and chose (1, 1)."""
DELAYS_S = (0.0, 1e-3, 5e-3, 10e-3)
"""s. Input delays that are compared."""
NOISE_LEVELS = (0.0, 0.25, 0.5, 1.0, 2.0)
"""Multiples of the measured output noise, for the study of the bias."""
BIAS_DURATION = 6.0
"""s. Length of the trace shown."""
SMALLEST_EXCITATION = 0.3
"""A/s rms of the averaged current: slower traces do not show a pole at tens of 1/s."""
TRAINING_SHARE = 2 / 3
"""Training share of a trace that serves for training and validation."""

PARAMETERS = ("pilot_valves.a1_s", "pilot_valves.b0_s", "pilot_valves.b1_s", "pilot_valves.h")


@dataclass(frozen=True)
class PoleCandidate:
    """One order and delay: simulated error on the validation data [Pa rms], one-step error on the training data [A rms]."""

    n: int
    m: int
    delay_s: float
    one_step: float
    simulated: float
    stable: bool


@dataclass(frozen=True)
class BiasPoint:
    """Pole [1/s] estimated in both ways from a simulated output with a multiple of the measured noise."""

    noise: float
    arx_pole: float
    output_error_pole: float


@dataclass(frozen=True)
class Check:
    """A trace against the simulated model.

    Attributes:
        trace: its name. valve: which. held_out: not used for the linear part.
        time: (n,) [s]; predicted, measured: (n,) averaged pressures [Pa]; NaN between stretches.
        rms: of the averaged pressures [Pa]. rms_raw: predicted from and compared with the samples as measured [Pa].
    """

    trace: str
    valve: str
    held_out: bool
    time: Array
    predicted: Array
    measured: Array
    rms: float
    rms_raw: float


@dataclass(frozen=True)
class ValveResult:
    """One valve.

    Attributes:
        valve: ``retract`` or ``extend``.
        training: name of the trace for the linear part. validation: of the one that is held out from it.
        split: both are the same trace: its first two thirds and the rest.
        arx: as in the thesis (averaged signals). arx_raw: from the samples as measured. model: output error.
    """

    valve: str
    training: str
    validation: str
    split: bool
    arx: FirstOrder
    arx_raw: FirstOrder
    model: FirstOrder
    candidates: tuple[PoleCandidate, ...]
    bias: tuple[BiasPoint, ...]


@dataclass(frozen=True)
class PilotValves:
    """All results of ch. 5.1.

    Attributes:
        traces: averaged. curve: h from the stationary points (5.2). curves: the same for each valve alone.
        valves: linear part of each. joint: curve and linear part of both valves together, fitted to all traces at once.
        checks: simulation against measurement. None or empty if the traces do not determine it.
    """

    traces: tuple[AveragedTrace, ...]
    curve: StaticCurve | None
    curves: dict[str, StaticCurve] = field(default_factory=dict)
    valves: tuple[ValveResult, ...] = ()
    joint: tuple[StaticCurve, FirstOrder] | None = None
    checks: tuple[Check, ...] = ()
    not_determined: tuple[NotDetermined, ...] = ()

    @property
    def final_curve(self) -> StaticCurve | None:
        """The curve for the machine file: from the joint fit if there is one."""
        return self.curve if self.joint is None else self.joint[0]

    def estimates(self) -> list[Identified]:
        """The determined parameters with intervals, named as in the machine file."""
        result = []
        curve = self.final_curve
        if curve is not None:
            how = f"(5.2), {curve.points} stationary points" + (", fitted with the linear part" if self.joint else "")
            for k, (value, unit) in enumerate(zip(curve.h, ("bar/A^2", "bar/A", "bar"), strict=True)):
                bounds = interval(value, float(curve.covariance[k, k]))
                result.append(Identified(f"pilot_valves.h.{k}", value, unit, bounds, how))
        if self.joint is not None:
            names = (("a1_s", "1/s"), ("b0_s", "1/s"), ("b1_s", "-"))
            rows = zip(names, self.joint[1].state_space, self.joint[1].intervals(), strict=True)
            how = f"output error of the whole Wiener model, {len(self.traces)} traces"
            result += [Identified(f"pilot_valves.{n}", value, unit, bounds, how) for (n, unit), value, bounds in rows]
        return result


def identify_pilot_valves(traces: Sequence[OscilloscopeTrace], progress: Progress = lambda _: None) -> PilotValves:
    """Apply chapter 5.1 to the given traces. Numbers that they do not determine are listed, never guessed."""
    progress("pilot valves: averaging and stationary points")
    prepared = tuple(a for a in (averaged(trace) for trace in traces) if a is not None)
    if not prepared:
        why = "the traces are shorter than the filters"
        return PilotValves((), None, not_determined=tuple(NotDetermined(key, why) for key in PARAMETERS))
    missing: list[NotDetermined] = []
    try:
        curve = fit_curve(prepared)
    except ValueError as error:
        # Without h there is no nu, and without nu no linear part.
        missing = [NotDetermined(key, str(error)) for key in PARAMETERS]
        return PilotValves(prepared, None, not_determined=tuple(missing))
    results: list[ValveResult] = []
    checks: list[Check] = []
    reasons = []
    for valve in VALVES:
        own = [t for t in prepared if t.trace.valve == valve]
        if not own:
            continue
        progress(f"pilot valves: linear part of the {valve} valve")
        try:
            results.append(_valve(valve, own, curve))
        except ValueError as error:
            reasons.append(f"{valve} valve: {error}")
    joint = None
    if results:
        progress("pilot valves: static curve and linear part together")
        try:
            joint = _joint(prepared, curve, results)
        except ValueError as error:
            reasons.append(str(error))
        used = joint or (curve, results[0].model)
        checks = [_check(trace, *used, results) for trace in prepared]
    if joint is None:
        missing += [NotDetermined(key, "; ".join(reasons)) for key in PARAMETERS[:3]]
    return PilotValves(prepared, curve, _own_curves(prepared), tuple(results), joint, tuple(checks), tuple(missing))


def _own_curves(traces: Sequence[AveragedTrace]) -> dict[str, StaticCurve]:
    """The curve of each valve by itself, to be compared with the common one; without those that cannot be fitted."""
    curves = {}
    for valve in VALVES:
        with suppress(ValueError):
            curves[valve] = fit_curve([t for t in traces if t.trace.valve == valve])
    return curves


def _joint(
    traces: Sequence[AveragedTrace], curve: StaticCurve, results: Sequence[ValveResult]
) -> tuple[StaticCurve, FirstOrder]:
    """Fit to all traces of both valves, except held-out ones and those with another sampling period than the first."""
    first = results[0].model
    parts = []
    for trace in traces:
        role = _role(trace, results)
        if trace.trace.period == first.period and role != "validation":
            parts += [_share(s, TRAINING_SHARE) if role == "split" else s for s in trace.stretches]
    return joint_fit(parts, traces[0].window, curve, first)


def _valve(valve: str, traces: Sequence[AveragedTrace], curve: StaticCurve) -> ValveResult:
    chosen = max(traces, key=_excitation)
    rate = _excitation(chosen)
    if rate < SMALLEST_EXCITATION:
        raise ValueError(
            f"the current of {chosen.trace.name} changes by {rate:.2f} A/s rms only, {SMALLEST_EXCITATION:g} A/s are needed"
        )
    split = len(traces) == 1
    validation = chosen if split else max((t for t in traces if t is not chosen), key=_changes)
    pairs = _pairs((_share(s, TRAINING_SHARE) if split else s for s in chosen.stretches), curve)
    held = _pairs((_share(s, -TRAINING_SHARE) if split else s for s in validation.stretches), curve)
    period = chosen.trace.period
    averaged_arx = first_order_arx(pairs, period)
    raw = [(s.raw_current, curve.inverse(s.raw_pressure)) for s in chosen.stretches]
    model = output_error(pairs, period, averaged_arx)
    return ValveResult(
        valve, chosen.trace.name, validation.trace.name, split, averaged_arx, first_order_arx(raw, period), model,
        _candidates(pairs, held, curve, period), _bias(chosen, curve, model),
    )  # fmt: skip


def _excitation(trace: AveragedTrace) -> float:
    """Rms of di/dt of the averaged current [A/s]."""
    rates = [np.diff(signals.moving_average(s.current, trace.window)) / s.period for s in trace.stretches]
    return float(np.sqrt(np.mean(np.concatenate(rates) ** 2)))


def _changes(trace: AveragedTrace) -> int:
    """Number of times a trace comes to rest: the trace of general shape has most steps and is the best check."""
    return sum(len(signals.stretches(s.stationary)) for s in trace.stretches)


def _pairs(stretches: Iterable[Averaged], curve: StaticCurve) -> list[Pair]:
    return [(s.current, curve.inverse(s.pressure)) for s in stretches]


def _candidates(
    pairs: Sequence[Pair], held: Sequence[Pair], curve: StaticCurve, period: float
) -> tuple[PoleCandidate, ...]:
    found = []
    for (n, m), delay_s in product(ORDERS, DELAYS_S):
        delay = round(delay_s / period)
        fitted = arx(pairs, n, m, delay)
        error = _simulated_error(fitted, held, curve) if fitted.stable else np.inf
        found.append(PoleCandidate(n, m, delay * period, fitted.one_step, error, fitted.stable))
    return tuple(found)


def _simulated_error(model: Arx, held: Sequence[Pair], curve: StaticCurve) -> float:
    errors = [curve.pressure(model.simulate(i, float(nu[0]))) - curve.pressure(nu) for i, nu in held]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def _bias(trace: AveragedTrace, curve: StaticCurve, model: FirstOrder) -> tuple[BiasPoint, ...]:
    """Both estimates on outputs simulated by the found model, with increasing white noise, not averaged."""
    longest = max(trace.stretches, key=lambda s: len(s.current))
    part = _share(longest, min(1.0, BIAS_DURATION / (len(longest.current) * longest.period)))
    clean = curve.pressure(model.simulate(part.current, float(curve.inverse(part.pressure[:1])[0])))
    sigma = float(np.std(np.diff(part.raw_pressure))) / np.sqrt(2.0)  # white: differences carry it twice
    noise = np.random.default_rng(0).standard_normal(len(clean))
    points = []
    for level in NOISE_LEVELS:
        pair = [(part.current, curve.inverse(clean + level * sigma * noise))]
        start = first_order_arx(pair, part.period)
        points.append(
            BiasPoint(level, start.continuous[0], output_error(pair, part.period, start).continuous[0])
        )  # fmt: skip
    return tuple(points)


def _check(trace: AveragedTrace, curve: StaticCurve, model: FirstOrder, results: Sequence[ValveResult]) -> Check:
    role = _role(trace, results)
    times, predicted, measured, raw = [], [], [], []
    for whole in trace.stretches:
        s = _share(whole, -TRAINING_SHARE) if role == "split" else whole
        start = float(np.mean(curve.inverse(s.pressure[:10])))
        times += [s.time, np.array([np.nan])]
        predicted += [curve.pressure(model.simulate(s.current, start)), np.array([np.nan])]
        measured += [s.pressure, np.array([np.nan])]
        raw.append(curve.pressure(model.simulate(s.raw_current, start)) - s.raw_pressure)
    p, m = np.concatenate(predicted), np.concatenate(measured)
    return Check(
        trace.trace.name, trace.trace.valve, role in ("validation", "split"), np.concatenate(times), p, m,
        float(np.sqrt(np.nanmean((p - m) ** 2))), float(np.sqrt(np.mean(np.concatenate(raw) ** 2))),
    )  # fmt: skip


def _role(trace: AveragedTrace, results: Sequence[ValveResult]) -> str:
    """Use of a trace: training, validation, split (both) or static."""
    for result in results:
        if result.valve == trace.trace.valve and result.training == trace.trace.name:
            return "split" if result.split else "training"
        if result.valve == trace.trace.valve and result.validation == trace.trace.name:
            return "validation"
    return "static"


def _share(s: Averaged, share: float) -> Averaged:
    """The first ``share`` of a stretch; the part after it if negative."""
    cut = round(abs(share) * len(s.current))
    part = slice(0, cut) if share > 0 else slice(cut, None)
    arrays = (s.current, s.pressure, s.raw_current, s.raw_pressure)
    start = s.start if share > 0 else s.start + cut * s.period
    current, pressure, raw_current, raw_pressure = (x[part] for x in arrays)
    return Averaged(start, s.period, current, pressure, raw_current, raw_pressure, s.stationary[part])
