"""Limits in the laws' expressions."""

from __future__ import annotations

import casadi as ca

from boom_model.regularisation import Expression


def limited(x: Expression, low: Expression, high: Expression) -> Expression:
    """X within low .. high. What is no number stays none, so that it is found: fmin and fmax would hide it."""
    return ca.if_else(x < low, low, ca.if_else(x > high, high, x))
