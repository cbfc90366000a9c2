"""Watches temperature, voltage and load of an energised arm, and decides when to disable its torque."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from joshua_servo.feedback import Feedback
from joshua_servo.status_bits import StatusBits

CONSECUTIVE_SAMPLES = 3  # the voltage dips briefly when several joints start together
MOST_SAMPLES = 30  # before torque, after which a value that is wrong now and then counts as wrong
SAMPLE_PAUSE_S = 0.02  # between samples outside a control loop, as in a loop of 50 Hz
TEMPERATURE_MARGIN_C = 10  # from this value to the limit is a warning


@dataclass(frozen=True)
class HealthLimits:
    """Limits of one servo, from its EEPROM."""

    max_temperature_c: int = 70
    min_voltage_v: float = 4.0
    max_voltage_v: float = 14.0


class HealthWatch:
    """Evaluates the feedback of one arm.

    Args:
        names: joint names; limits: of each servo, in the same order.
        status: meaning of the servos' status bits.
    """

    def __init__(self, names: Sequence[str], limits: Sequence[HealthLimits], status: StatusBits) -> None:
        self.status = status
        self._names = tuple(names)
        self._limits = tuple(limits)
        self._voltage_samples = [0] * len(self._names)

    def reset(self) -> None:
        """Reset the counters."""
        self._voltage_samples = [0] * len(self._names)

    @property
    def undecided(self) -> bool:
        """Whether the samples so far neither trip nor show that every value is within its limits."""
        return any(self._voltage_samples)

    def is_overload_alone(self, reading: Feedback) -> bool:
        """Whether a servo reports an overload and no other fault."""
        return reading.status & self.status.at_once == self.status.overload

    def reported(self, index: int, reading: Feedback) -> str:
        """The reported errors of a servo, for a person."""
        return (
            f"{self._names[index]}: the servo reports: {self.status.describe(reading.status)} "
            f"(load {reading.load:+.0%}, {reading.temperature_c} °C, {reading.voltage_v:.1f} V)"
        )

    def trip_reason(self, readings: Sequence[Feedback], without: Collection[int] = ()) -> str:
        """Why to disable the torque, "" if there is no reason. Adds one sample of all servos.

        Args:
            without: indices of joints without torque.
        """
        for index, reading in enumerate(readings):
            if index in without:
                continue
            limits, name = self._limits[index], self._names[index]
            if reading.status & self.status.at_once:
                return self.reported(index, reading)
            if reading.temperature_c > limits.max_temperature_c:
                return f"{name}: {reading.temperature_c} °C, at most {limits.max_temperature_c} °C"
            if limits.min_voltage_v <= reading.voltage_v <= limits.max_voltage_v:
                self._voltage_samples[index] = 0
                continue
            self._voltage_samples[index] += 1
            if self._voltage_samples[index] >= CONSECUTIVE_SAMPLES:
                return (
                    f"{name}: {reading.voltage_v:.1f} V, allowed {limits.min_voltage_v:.1f} to "
                    f"{limits.max_voltage_v:.1f} V"
                )
        return ""

    def warning(self, index: int, reading: Feedback) -> str:
        """The value of a joint that is close to a limit, "" if none is."""
        limits = self._limits[index]
        if reading.status:
            return self.status.describe(reading.status)
        if reading.temperature_c > limits.max_temperature_c - TEMPERATURE_MARGIN_C:
            return f"{reading.temperature_c} °C, close to its limit of {limits.max_temperature_c} °C"
        if not limits.min_voltage_v <= reading.voltage_v <= limits.max_voltage_v:
            return f"voltage {reading.voltage_v:.1f} V out of range"
        return ""
