"""Sensors: the concealed forms."""

from __future__ import annotations

from concealed_plant.hidden import Array, Hidden, Scene, Sensing, conceals, sign


@conceals(
    "angle_offset", "sensors", "rad", (2e-4, 0.25), "with the small distortion of a sensor that is also tilted sideways"
)
def angle_offset(size: float, r: Array, _scene: Scene) -> Hidden:
    """IMU mounted askew."""
    offset = sign(r[0]) * size
    return Hidden(sensing=Sensing(angle_offset=offset, angle_skew=0.05 * offset), parameters={"b": offset})


@conceals("rate_scale", "sensors", "-", (1e-3, 0.3), "with a little lag of the gyro's filter")
def rate_scale(size: float, r: Array, _scene: Scene) -> Hidden:
    """Gain of the gyro."""
    gain = 1.0 + sign(r[0]) * size
    return Hidden(sensing=Sensing(rate_gain=gain, rate_lag=0.05 * size), parameters={"a": gain})


@conceals("pressure_bias", "sensors", "Pa", (3e3, 5e6), "drifts by a twentieth over the recording")
def pressure_bias(size: float, r: Array, _scene: Scene) -> Hidden:
    """Offset of one transducer."""
    bias = sign(r[0]) * size
    if r[1] < 0.5:
        return Hidden(sensing=Sensing(hose_bias=bias, bias_drift=0.05), parameters={"hose": bias})
    return Hidden(sensing=Sensing(rod_bias=bias, bias_drift=0.05), parameters={"rod": bias})


@conceals("pressure_delay", "sensors", "s", (5e-4, 0.3), "half dead time, half filter")
def pressure_delay(size: float, _r: Array, _scene: Scene) -> Hidden:
    """Both pressures arrive late."""
    return Hidden(sensing=Sensing(pressure_dead_time=size / 2, pressure_lag=size / 2), parameters={"T": size})
