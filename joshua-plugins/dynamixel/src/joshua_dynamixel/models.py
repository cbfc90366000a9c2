"""Models of the X series that the driver knows, as data. Source: the vendor's manuals, at nominal voltage."""

from __future__ import annotations

from dataclasses import dataclass

from joshua_dynamixel.registers import TICKS_PER_TURN


@dataclass(frozen=True)
class Model:
    """One model.

    Attributes:
        number: model number.
        rpm: no-load speed; stall_a: current at stall.
        current_unit_a: unit of the current register, 0 if the servo measures a load instead.
    """

    name: str
    number: int
    rpm: float
    stall_a: float
    current_unit_a: float

    @property
    def max_speed_ticks_s(self) -> float:
        """No-load speed."""
        return self.rpm / 60 * TICKS_PER_TURN

    def load(self, raw: int) -> float:
        """Return the load as a signed fraction of stall torque, from the load or current register."""
        if not self.current_unit_a:
            return raw / 1000
        return raw * self.current_unit_a / self.stall_a

    def current_a(self, raw: int) -> float:
        """Return the current from the load or current register; an estimate if the servo measures load."""
        return abs(raw) * self.current_unit_a if self.current_unit_a else abs(raw) / 1000 * self.stall_a


MODELS = {
    model.name: model
    for model in (
        Model("xl330-m077", 1190, 383.0, 1.47, 0.001),
        Model("xl330-m288", 1200, 103.0, 1.47, 0.001),
        Model("xl430-w250", 1060, 61.0, 1.4, 0.0),
        Model("xm430-w210", 1030, 77.0, 2.3, 0.00269),
        Model("xm430-w350", 1020, 46.0, 2.3, 0.00269),
        Model("xm540-w150", 1130, 53.0, 4.4, 0.00269),
        Model("xm540-w270", 1120, 30.0, 4.4, 0.00269),
    )
}

_NAMES = {model.number: model.name for model in MODELS.values()}


def model_name(number: int) -> str:
    """Return the name of a model by its number, or ``model 1234`` if it is unknown."""
    return _NAMES.get(number, f"model {number}")
