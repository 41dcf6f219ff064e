"""A relief valve at a port of the main valve opens to the tank: q = c max(0, p - p_set) out of the port.

Also called shock or secondary relief valve. Sections that drive a cylinder without a load-holding valve have one at each port, set
above what the pump can give; one that is set too low, or weak, lets the boom sink in every hard stop. c: 0.2 to 3 l/min per bar.
"""

from typing import Any

from boom_model.catalogue.effect import Effect, EffectParameter, parameter
from boom_model.regularisation import Expression, ramp

SLOPE = 1.0 / 60_000.0 / 1e5
"""m^3/s/Pa: 1 l/min per bar."""
WIDTH = 5e4
"""Pa, over which it begins to open."""
TRIED = (60e5, 100e5, 140e5, 190e5)
"""Pa."""


def _opening(port: str, **more: Any) -> tuple[EffectParameter, EffectParameter]:
    return (
        parameter(port, "m^3/s/Pa", 0.0, (0.1 * SLOPE, 2.0 * SLOPE), (0.0, 50.0 * SLOPE),
                  f"flow out of the {port}'s port per pressure above the set one", **more),
        parameter(f"{port}_set", "Pa", 150e5, (50e5, 250e5), (1e5, 1e8), f"pressure at which the {port}'s opens", positive=True,
                  of=port),
    )  # fmt: skip


def _relief(flow: Expression, own: Any, at: Any) -> Expression:
    slope, opens = {"hose": (own.hose, own.hose_set), "rod": (own.rod, own.rod_set)}[at.port]
    return flow - slope * ramp(at.pressure - opens, WIDTH)


EFFECT = Effect(
    "port_relief_valve", "main_valve", "5.39d,i", "c max(0, p - p_set) out of each port, to the tank",
    ("a relief valve at a port of the main valve", "opens"), "only above its pressure: hard stops, starts, loads held far out",
    (*_opening("hose"), *_opening("rod", leads=True)),
    {"port_leakage": _relief},
    place=11, watched=False, foreign=True,
    points=tuple((0.3 * SLOPE, p, 0.0, 150e5) for p in TRIED) + tuple((0.0, 150e5, 0.3 * SLOPE, p) for p in TRIED),
)  # fmt: skip
