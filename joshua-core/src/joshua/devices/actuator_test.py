"""What an actuator's node measures for the table of MODE_TEST."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from joshua.devices.actuator import FloatArray, JointLimits, JointReading
from joshua.devices.diagnostics import DiagnosticStatus
from joshua.devices.joint_command import CommandReader
from joshua.devices.motion_recorder import MotionRecorder
from joshua.node.rates import RateMeter, meter_for
from joshua.plan import JointTrace, NodeSpec

#: Root mean square of the distance between goal and position that still counts as following.
TRACKING_ERROR_MAX_RAD = 0.1

#: Way beyond a limit that the play of a gear explains.
RANGE_TOLERANCE_RAD = 0.05

Result = tuple[str, bool, str]


class ActuatorTest:
    """Collects the figures of one actuator.

    Args:
        spec: the node's part of the plan.
    """

    def __init__(self, spec: NodeSpec) -> None:
        self._spec = spec
        self._meters: dict[str, RateMeter] = {}
        self._states = 0
        self._goal: FloatArray | None = None
        self._squares = 0.0
        self._largest_rad = 0.0
        self._samples = 0
        self._outside_rad = 0.0
        self._finite = True
        self._recorder = MotionRecorder() if spec.context.get("testing") else None

    def meter(self, topic: str) -> RateMeter:
        """The counter of the messages on a topic."""
        return self._meters.setdefault(topic, meter_for(self._spec))

    def state(self, reading: JointReading, limits: JointLimits) -> None:
        """Takes a state, and compares it with the goal of the cycle before."""
        self._states += 1
        position = reading.position_rad
        if not np.isfinite(position).all():
            self._finite = False
            return
        beyond = np.maximum(limits.position_min_rad - position, position - limits.position_max_rad)
        self._outside_rad = max(self._outside_rad, float(beyond.max(initial=0.0)))
        if self._goal is not None:
            error_rad = position - self._goal
            self._squares += float(np.mean(error_rad**2))
            self._largest_rad = max(self._largest_rad, float(np.abs(error_rad).max(initial=0.0)))
            self._samples += 1
        if self._recorder is not None:
            self._recorder.state(reading)

    def written(self, goal_rad: FloatArray, *, following: bool) -> None:
        """Takes what was written; only goals that follow commands count for the tracking error."""
        self._goal = goal_rad if following else None
        if self._recorder is not None:
            self._recorder.written(goal_rad)

    def diagnosed(self, rows: Sequence[DiagnosticStatus]) -> Sequence[DiagnosticStatus]:
        """Takes the rows of the device's diagnostics, and hands them on."""
        if self._recorder is not None:
            self._recorder.diagnosed(rows)
        return rows

    def traces(self) -> list[JointTrace]:
        """What was recorded in MODE_TEST, one trace for each joint."""
        names = [str(joint["name"]) for joint in self._spec.context.get("joints", ())]
        return self._recorder.traces(names) if self._recorder is not None else []

    def results(self, readers: Sequence[CommandReader]) -> list[Result]:
        """The rows of the table."""
        rows = [
            self.meter(topic.name).check(f"rate of {topic.name}", topic.rate_hz)
            for topic in self._spec.publishers
        ]
        if not self._finite:
            rows.append(("positions", False, "a position was not a finite number"))
        elif self._states:
            inside = self._outside_rad <= RANGE_TOLERANCE_RAD
            text = "within the limits" if inside else f"up to {self._outside_rad:.3f} rad beyond the limits"
            rows.append(("positions", inside, text))
        for reader in readers:
            meter = self.meter(reader.topic)
            text = f"{reader.accepted} at {meter.rate_hz:.4g} Hz"
            text += f", {reader.refused} refused" if reader.refused else ""
            rows.append((f"commands on {reader.topic}", reader.accepted > 0 and not reader.refused, text))
        rows += self._tracking(bool(readers))
        if self._recorder is not None:
            rows += self._recorder.results()
        return rows

    def _tracking(self, is_commanded: bool) -> list[Result]:
        if self._samples:
            error_rad = math.sqrt(self._squares / self._samples)
            good = error_rad <= TRACKING_ERROR_MAX_RAD
            text = (
                f"{error_rad:.4f} rad rms, {self._largest_rad:.4f} rad at most over {self._samples} cycles, "
                f"{TRACKING_ERROR_MAX_RAD} rad rms allowed"
            )
            return [("tracking error", good, text)]
        if is_commanded:
            return [("tracking error", False, "no cycle followed a command")]
        return []
