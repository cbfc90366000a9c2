"""A motor that answers on a bus."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FoundMotor:
    """A motor that answers on a bus.

    Attributes:
        motor_id: bus id; baudrate: line speed at which it replies, bit/s.
        model: name of the model, or ``model 1234`` where it is unknown; firmware: "" if unknown.
        voltage_v, temperature_c: None if the motor does not report it.
        max_temperature_c, min_voltage_v, max_voltage_v: limits beyond which it protects itself; None if it
            reports none.
        status: fault that the motor reports, such as ``overloaded``; "" for none.
        shared: several motors have this id and their replies collide; everything else is unknown.
    """

    motor_id: int
    baudrate: int
    model: str = ""
    firmware: str = ""
    voltage_v: float | None = None
    temperature_c: float | None = None
    max_temperature_c: float | None = None
    min_voltage_v: float | None = None
    max_voltage_v: float | None = None
    status: str = ""
    shared: bool = False

    @property
    def alarms(self) -> list[str]:
        """Why the motor protects itself or would do so with torque: its reported fault, heat, the supply."""
        found = [self.status] if self.status else []
        heat, most_c = self.temperature_c, self.max_temperature_c
        if heat is not None and most_c is not None and heat > most_c:
            found.append(f"{heat:.0f} °C, at most {most_c:.0f} °C")
        supply, least_v, most_v = self.voltage_v, self.min_voltage_v, self.max_voltage_v
        if supply is None or least_v is None or most_v is None:
            return found
        if not least_v <= supply <= most_v:
            found.append(f"{supply:.1f} V, allowed {least_v:.1f} to {most_v:.1f} V")
        return found

    def __str__(self) -> str:
        if self.shared:
            return f"{self.motor_id} (several motors)"
        firmware = f", firmware {self.firmware}" if self.firmware else ""
        return f"{self.motor_id} ({self.model}{firmware})"
