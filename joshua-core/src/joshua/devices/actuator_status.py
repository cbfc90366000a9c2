"""The state of an actuator for ``/diagnostics``: of the whole, and of each joint as last read."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from joshua.devices.actuator import Actuator, JointReading
from joshua.devices.command_intake import Commanders
from joshua.devices.diagnostics import DiagnosticStatus
from joshua.devices.errors import DeviceSilent
from joshua.devices.joint_command import shown_publisher
from joshua.guardian.silence import AwakeClock
from joshua.plan import NodeSpec

#: A USB hub that re-enumerates delays every reply by 0.1 to 0.2 s. Nothing is written meanwhile, so the
#: joints stay at their last goal.
SILENCE_LIMIT_S = 0.4

#: A delay of the device may delay its driver, too. So at least this many readings are tried …
LEAST_MISSES = 5
#: … within this time.
LONGEST_SILENCE_S = 1.0


class Patience:
    """Decides how many missed readings of an actuator are tolerated.

    Args:
        limit_s: time without a reply that its node does not tolerate; clock: monotonic seconds.

    Attributes:
        missed: missed readings of the present gap; longest_s: the longest gap that ended.
    """

    def __init__(self, limit_s: float = SILENCE_LIMIT_S, clock: Callable[[], float] = time.monotonic) -> None:
        self._limit_s = limit_s
        self._clock = AwakeClock(clock, limit_s / LEAST_MISSES)
        self._began = (0.0, 0.0)
        self._since: tuple[float, float] | None = None
        self.missed = 0
        self.longest_s = 0.0

    def begin(self) -> None:
        """A reading begins."""
        self._began = (self._clock.now_s(), self._clock.looked_s)

    def miss(self) -> bool:
        """The reading failed. Returns whether that is still tolerated."""
        self.missed += 1
        awake_s, now_s = self._clock.now_s(), self._clock.looked_s
        self._since = self._since or self._began
        silent_s, since_s = awake_s - self._since[0], now_s - self._since[1]
        return silent_s < self._limit_s and (since_s < LONGEST_SILENCE_S or self._since is self._began)

    def hear(self) -> float:
        """The reading succeeded. Returns the length of the gap that it ends, 0 if there was none."""
        if self._since is None:
            return 0.0
        self._clock.now_s()
        silence_s, self._since = self._clock.looked_s - self._since[1], None
        self.longest_s = max(self.longest_s, silence_s)
        return silence_s


class ActuatorStatus:
    """The state of one actuator.

    Args:
        spec: the node's part of the plan.

    Attributes:
        fault: why it has no torque and follows no commands until it is resumed; "" for none.
        doing: activity of its joints, while there is no fault.
        reading: the last one; patience: tolerance of missed ones.
    """

    def __init__(self, spec: NodeSpec) -> None:
        self._spec = spec
        self.fault = ""
        self.doing = "read only"
        self.reading: JointReading | None = None
        self.patience = Patience()
        self._missed_reported = 0

    def read(self, actuator: Actuator, log: Any) -> JointReading | None:
        """Reads the device; None if it did not reply, which is tolerated for a moment. Raises DeviceError."""
        self.patience.begin()
        try:
            reading = actuator.read()
        except DeviceSilent as error:
            if not self.patience.miss():
                raise
            log.debug("this cycle is skipped: %s", error)
            return None
        silence_s = self.patience.hear()
        if silence_s:
            log.warning("no reply for %.2f s: the cycles in between were skipped", silence_s)
        self.reading = reading
        return reading

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
        patience = self.patience
        missed, self._missed_reported = patience.missed - self._missed_reported, patience.missed
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
            {"readings_missed": str(patience.missed), "longest_silence_s": f"{patience.longest_s:.3f}"},
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
