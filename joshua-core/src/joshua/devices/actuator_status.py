"""The state of an actuator for ``/diagnostics``: of the whole, and of each joint as last read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from joshua.devices.actuator import Actuator, JointReading
from joshua.devices.command_intake import Commanders
from joshua.devices.diagnostics import DiagnosticStatus
from joshua.devices.errors import DeviceSilent
from joshua.devices.joint_command import shown_publisher
from joshua.guardian.silence import Patience
from joshua.plan import NodeSpec

#: Shorter delays of the driver are not reported.
TELLING_DELAY_S = 0.05


class ActuatorStatus:
    """The state of one actuator.

    Args:
        spec: the node's part of the plan; period_s: of its readings.

    Attributes:
        fault: why it has no torque and follows no commands until it is resumed; "" for none.
        doing: activity of its joints, while there is no fault.
        reading: the last one; missed: number of failed ones; longest_gap_s: between two that succeeded.
    """

    def __init__(self, spec: NodeSpec, period_s: float = 0.02) -> None:
        self._spec = spec
        self.fault = ""
        self.doing = "read only"
        self.reading: JointReading | None = None
        self.missed = 0
        self.longest_gap_s = 0.0
        self._patience = Patience(period_s=period_s)
        self._missed_reported = 0

    def read(self, actuator: Actuator, log: Any) -> JointReading | None:
        """Reads the device; None if it did not reply, which is tolerated for a moment. Raises DeviceError."""
        self._patience.begin()
        try:
            reading = actuator.read()
        except DeviceSilent as error:
            self.missed += 1
            if not self._patience.miss():
                if self._patience.is_silent and not self._delay():
                    raise
                raise self._lost(error) from error
            log.debug("this cycle is skipped: %s", error)
            return None
        gap_s = self._patience.hear()
        if gap_s:
            self.longest_gap_s = max(self.longest_gap_s, gap_s)
            delay = self._delay()
            log.warning("no reply for %.2f s%s: the cycles in between were skipped", gap_s, delay)
        self.reading = reading
        return reading

    def _delay(self) -> str:
        delayed_s = self._patience.delayed_s
        if delayed_s <= TELLING_DELAY_S:
            return ""
        return f", of which this driver was delayed by {delayed_s:.2f} s"

    def _lost(self, error: DeviceSilent) -> DeviceSilent:
        """The error that ends the patience. It blames the device only if that had the time to reply."""
        patience = self._patience
        if not patience.is_silent:
            return DeviceSilent(
                f"no reply for {patience.gap_s:.2f} s{self._delay()}: the machine is too busy to tell "
                "whether the device is at fault. Close other programs, then try again. `joshua doctor` says "
                "how to give drivers priority."
            )
        return DeviceSilent(f"{error} (no reply for {patience.gap_s:.2f} s{self._delay()})")

    def rows(self, actuator: Actuator, commanders: Commanders | None = None) -> list[DiagnosticStatus]:
        """Returns a row for the whole actuator and the driver's rows, by default one for each joint."""
        rows = list(actuator.diagnostics())
        hardware_id = f"{self._spec.plugin} {self._spec.block}"
        summary = self._summary(hardware_id)
        if commanders is not None:
            ignored = dict(commanders.ignored)
            values = {
                "commander": commanders.current or "",
                "commands_refused": str(sum(commanders.refused.values())),
                "commands_without_effect": str(sum(ignored.values())),
                "publishers_without_effect": ", ".join(map(shown_publisher, ignored)),
            }
            summary = replace(summary, values={**summary.values, **values})
        return [summary, *(rows or self._joint_rows(actuator.joint_names, hardware_id))]

    def _summary(self, hardware_id: str) -> DiagnosticStatus:
        missed, self._missed_reported = self.missed - self._missed_reported, self.missed
        message = self.fault or f"in order: {self.doing}"
        if missed and not self.fault:
            message = f"{self.doing}; {missed} readings failed since the last report"
        return DiagnosticStatus(
            DiagnosticStatus.ERROR
            if self.fault
            else DiagnosticStatus.WARN
            if missed
            else DiagnosticStatus.OK,
            "",
            message,
            hardware_id,
            {"readings_missed": str(self.missed), "longest_silence_s": f"{self.longest_gap_s:.3f}"},
        )

    def _joint_rows(self, names: Sequence[str], hardware_id: str) -> list[DiagnosticStatus]:
        reading = self.reading
        if reading is None:
            return []
        return [
            DiagnosticStatus(
                DiagnosticStatus.OK,
                name,
                "in order",
                hardware_id,
                {
                    "position_rad": f"{reading.position_rad[index]:.4f}",
                    "velocity_rad_s": f"{reading.velocity_rad_s[index]:.3f}",
                    "effort": f"{reading.effort[index]:+.3f}",
                },
            )
            for index, name in enumerate(names)
        ]
