"""The spool vents both ports to the tank in neutral, which the file says are shut (``components.neutral_position``)."""

from typing import Any

from boom_model.catalogue.effect import Effect, parameter
from boom_model.components import neutral_position
from boom_model.regularisation import Expression


def _area(area: Expression, own: Any, at: Any) -> Expression:
    return area + own.A_v * neutral_position.remaining(at.position, own.x_v, at.p)


EFFECT = Effect(
    "vented_neutral", "main_valve", "5.39l,m", "q = -C_d A_v max(0, 1 - x / x_v) sqrt(2 / rho) sqrt(p - p_t)",
    ("the spool of the main valve", "vents both ports in neutral"),
    "both pressures at the valve fall to the tank's at rest",
    (
        parameter("A_v", "m^2", 0.0, (1e-6, 3e-5), (0.0, 1e-3), "area from each port to the tank in neutral", positive=True,
                  starts=(3e-6, 1e-5), almost_nothing=1e-8),
        parameter("x_v", "-", 0.1, (0.04, 0.15), (1e-3, 0.9), "spool position over full stroke that shuts it", positive=True),
    ),
    {"neutral_area": _area},
    place=8, independent=True, needs="load_holding_valve shut_neutral", watched=False,
)  # fmt: skip
