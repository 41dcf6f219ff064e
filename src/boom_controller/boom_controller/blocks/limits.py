"""Limits in the laws' expressions."""

from __future__ import annotations

import casadi as ca

from boom_model.regularisation import Expression


def limited(x: Expression, low: Expression, high: Expression) -> Expression:
    """X within low .. high. NaN stays NaN, so that it is detected: fmin and fmax would hide it."""
    return ca.if_else(x < low, low, ca.if_else(x > high, high, x))
