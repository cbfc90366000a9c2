"""Differences between the models of the X series, as data.

Source: the vendor's manual of each model, at its nominal voltage.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Model:
    """One model.

    Attributes:
        number: model number; volts: nominal supply.
        rpm: no-load speed; stall_a: current at stall.
        current_unit_a: unit of the current registers, 0 if the servo measures a load instead.
        defaults: initial values of registers that differ from model to model.
    """

    name: str
    number: int
    volts: float
    rpm: float
    stall_a: float
    current_unit_a: float
    defaults: Mapping[str, int] = field(default_factory=dict)


def _defaults(
    celsius: int, volts: tuple[int, int], velocity: int, current: int, shutdown: int = 52
) -> dict[str, int]:
    return {
        "max_temperature": celsius,
        "max_voltage": volts[1],
        "min_voltage": volts[0],
        "velocity_limit": velocity,
        "current_limit": current,
        "shutdown": shutdown,
    }


_XL330_VOLTS, _XL430_VOLTS, _XM_VOLTS = (35, 70), (60, 140), (95, 160)

MODELS = {
    model.name: model
    for model in (
        Model("xl330-m077", 1190, 5.0, 383.0, 1.47, 0.001, _defaults(70, _XL330_VOLTS, 1620, 1750, 53)),
        Model("xl330-m288", 1200, 5.0, 103.0, 1.47, 0.001, _defaults(70, _XL330_VOLTS, 445, 1750, 53)),
        Model("xl430-w250", 1060, 12.0, 61.0, 1.4, 0.0, _defaults(72, _XL430_VOLTS, 265, 0)),
        Model("xm430-w210", 1030, 12.0, 77.0, 2.3, 0.00269, _defaults(80, _XM_VOLTS, 330, 1193)),
        Model("xm430-w350", 1020, 12.0, 46.0, 2.3, 0.00269, _defaults(80, _XM_VOLTS, 200, 1193)),
        Model("xm540-w150", 1130, 12.0, 53.0, 4.4, 0.00269, _defaults(80, _XM_VOLTS, 230, 2047)),
        Model("xm540-w270", 1120, 12.0, 30.0, 4.4, 0.00269, _defaults(80, _XM_VOLTS, 128, 2047)),
    )
}
