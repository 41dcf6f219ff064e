"""Small computed recordings for the tests: a boom that rests, moves and rests again, with the sensors' noise."""

import numpy as np

from boom_recording.recording import Configuration, Recording
from boom_recording.writing import from_columns

CONFIGURATION = Configuration("tz17", 0.28, 2.2, 0.0, "test")


def columns(duration: float = 6.0, seed: int = 0) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times (n,) [s] and six signals (n,) [SI]: rest, lift from a third to two thirds of the time, rest."""
    random = np.random.default_rng(seed)
    time = np.arange(round(duration * 100)) * 0.01
    moving = (time > duration / 3) & (time < 2 * duration / 3)
    rate = np.where(moving, 0.2, 0.0)
    angle = 0.3 + np.cumsum(rate) * 0.01
    quantum = 2 * np.pi / 2**14
    noise = lambda size, step: np.round(size * random.normal(size=len(time)) / step) * step  # noqa: E731
    extend = np.maximum(np.where(moving, 0.4, 0.0) + noise(8e-4, 1e-3), 0)
    return time, {
        "angle": np.round(angle / quantum) * quantum,
        "rate": rate + 1.5e-3 * random.normal(size=len(time)),
        "hose_pressure": 1e7 + 1e6 * rate + noise(1.7e4, 1e4),
        "rod_pressure": 4e6 - 1e6 * rate + noise(1.7e4, 1e4),
        "retract_current": np.maximum(noise(8e-4, 1e-3), 0),
        "extend_current": extend,
    }


def recording(duration: float = 6.0, seed: int = 0) -> Recording:
    """The same as a `Recording` whose topics are not sampled simultaneously."""
    time, signals = columns(duration, seed)
    phase = {"/boom/hose_pressure": 0.0013, "/boom/rod_pressure": 0.0018, "/boom/solenoid_currents": 0.0029}
    return from_columns("made", time, signals, CONFIGURATION, phase_s=phase)
