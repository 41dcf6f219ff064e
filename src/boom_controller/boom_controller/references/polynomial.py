"""Polynomials of time, the pieces of a reference between two points.

q(t) = c_0 + c_1 t + ... + c_5 t^5, t counted from the beginning of the piece. Conditions at both ends give the coefficients:
angle, rate and acceleration a quintic, angle and rate a cubic, angle alone a straight line. Source: Hermite interpolation.
"""

from __future__ import annotations

from boom_controller.types import Reference

_SHORTEST = 1e-9


class Polynomial:
    """q(t) = sum of c_k t^k [rad] with at most six coefficients."""

    __slots__ = ("_c",)

    def __init__(self, *coefficients: float) -> None:
        padded = (*coefficients, 0.0, 0.0, 0.0, 0.0, 0.0)[:6]
        self._c = (padded[0], padded[1], padded[2], padded[3], padded[4], padded[5])

    @property
    def coefficients(self) -> tuple[float, ...]:
        """c_0 to c_5."""
        return self._c

    def at(self, t: float) -> Reference:
        """Angle [rad], rate, acceleration and jerk at the time `t` [s] since the piece began."""
        c0, c1, c2, c3, c4, c5 = self._c
        return Reference(
            c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
            c1 + t * (2 * c2 + t * (3 * c3 + t * (4 * c4 + t * 5 * c5))),
            2 * c2 + t * (6 * c3 + t * (12 * c4 + t * 20 * c5)),
            6 * c3 + t * (24 * c4 + t * 60 * c5),
        )


def linear(begin: float, end: float, duration: float) -> Polynomial:
    """A straight line between two angles [rad] in `duration` [s]."""
    return Polynomial(begin, (end - begin) / max(duration, _SHORTEST))


def cubic(begin: tuple[float, float], end: tuple[float, float], duration: float) -> Polynomial:
    """The cubic with (angle [rad], rate [rad/s]) at both ends, `duration` [s] apart."""
    T = max(duration, _SHORTEST)
    (q0, v0), (q1, v1) = begin, end
    return Polynomial(q0, v0, (3 * (q1 - q0) / T - 2 * v0 - v1) / T, (2 * (q0 - q1) / T + v0 + v1) / T**2)


def quintic(begin: tuple[float, float, float], end: tuple[float, float, float], duration: float) -> Polynomial:
    """The quintic with (angle [rad], rate [rad/s], acceleration [rad/s^2]) at both ends, `duration` [s] apart."""
    T = max(duration, _SHORTEST)
    (q0, v0, a0), (q1, v1, a1) = begin, end
    # what is still missing at the end of the parabola that the beginning alone would give
    q = q1 - q0 - T * (v0 + 0.5 * a0 * T)
    v = v1 - v0 - a0 * T
    a = a1 - a0
    return Polynomial(
        q0,
        v0,
        0.5 * a0,
        (10 * q / T - 4 * v + 0.5 * a * T) / T**2,
        (-15 * q / T + 7 * v - a * T) / T**3,
        (6 * q / T - 3 * v + 0.5 * a * T) / T**4,
    )


def to_rest(begin: Reference, duration: float) -> Polynomial:
    """From any motion to rest in `duration` [s]: the rate falls to zero as a cubic, the acceleration ends at zero too.

    v(t) = v_0 + a_0 t - (3 v_0 + 2 a_0 T) (t/T)^2 + (2 v_0 + a_0 T) (t/T)^3. From v_0 alone the largest deceleration is
    1.5 v_0 / T and the way v_0 T / 2.
    """
    T = max(duration, _SHORTEST)
    v0, a0 = begin.rate, begin.acceleration
    return Polynomial(begin.angle, v0, 0.5 * a0, -(3 * v0 + 2 * a0 * T) / (3 * T**2), (2 * v0 + a0 * T) / (4 * T**3))
