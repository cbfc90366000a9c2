"""How an actuator is, for ``/diagnostics``: the whole of it, and its joints as last read."""

from __future__ import annotations

from collections.abc import Sequence

from joshua.devices.actuator import Actuator, JointReading
from joshua.devices.diagnostics import ERROR, OK, WARN, DiagnosticStatus
from joshua.devices.patience import Patience
from joshua.plan import NodeSpec


class ActuatorStatus:
    """What is known of one actuator.

    Args:
        spec: the node's part of the plan.

    Attributes:
        fault: why it has no torque and follows nothing until it is resumed; "" for none.
        doing: what its joints do, while there is no fault.
        reading: the last one; patience: with those that did not come.
    """

    def __init__(self, spec: NodeSpec) -> None:
        self._spec = spec
        self.fault = ""
        self.doing = "read only"
        self.reading: JointReading | None = None
        self.patience = Patience()
        self._missed_reported = 0

    def rows(self, actuator: Actuator) -> list[DiagnosticStatus]:
        """A row of the whole actuator, and the driver's; one for each joint where the driver has none."""
        rows = list(actuator.diagnostics())
        hardware_id = f"{self._spec.plugin} {self._spec.block}"
        return [self._summary(hardware_id), *(rows or self._joint_rows(actuator.joint_names, hardware_id))]

    def _summary(self, hardware_id: str) -> DiagnosticStatus:
        patience = self.patience
        missed, self._missed_reported = patience.missed - self._missed_reported, patience.missed
        message = self.fault or f"in order: {self.doing}"
        if missed and not self.fault:
            message = f"{self.doing}; {missed} readings did not come since the last report"
        return DiagnosticStatus(
            ERROR if self.fault else WARN if missed else OK,
            "",
            message,
            hardware_id,
            {"readings_missed": str(patience.missed), "longest_silence_s": f"{patience.longest_s:.3f}"},
        )

    def _joint_rows(self, names: Sequence[str], hardware_id: str) -> list[DiagnosticStatus]:
        reading = self.reading
        if reading is None:
            return []
        return [
            DiagnosticStatus(
                OK,
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
