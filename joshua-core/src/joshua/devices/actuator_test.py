"""The measurements of an actuator's node for the table of MODE_TEST."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from joshua.devices.actuator import FloatArray, JointLimits, JointReading
from joshua.devices.diagnostics import DiagnosticStatus
from joshua.devices.joint_command import CommandReader
from joshua.node.cadence import TrafficFigures
from joshua.plan import ActuatorFacts, JointTrace, NodeSpec

#: At this number of samples, every other one is dropped, and from then on only every other cycle is recorded.
MOST_SAMPLES = 4000

#: Upper limit of the values in a report, which keeps it far below the frame limit between processes.
MOST_VALUES = 120_000

#: Upper limit of the temperatures of a joint.
MOST_TEMPERATURES = 1000

#: Longest lag that is searched for.
LAG_MAX_S = 1.0

#: A goal must move by this much for a lag to be measured.
MOVES_RAD = 0.02

Result = tuple[str, bool, str]


class MotionRecorder:
    """Goal, position, effort and temperature of the joints of one actuator."""

    def __init__(self) -> None:
        self._stride = 1
        self._cycle = -1
        self._stamps_ns: list[int] = []
        self._positions: list[FloatArray] = []
        self._efforts: list[FloatArray] = []
        self._goals: list[FloatArray | None] = []
        self._temperatures: dict[str, list[tuple[int, float]]] = {}
        self._load_is_fraction = False

    def state(self, reading: JointReading) -> None:
        """Adds the state at the beginning of a cycle."""
        self._cycle += 1
        if self._cycle % self._stride:
            return
        if len(self._stamps_ns) >= MOST_SAMPLES:
            self._thin_out()
        self._stamps_ns.append(reading.stamp_ns)
        self._positions.append(reading.position_rad.copy())
        self._efforts.append(reading.effort.copy())
        self._goals.append(None)

    def written(self, goal_rad: FloatArray) -> None:
        """Adds the goal written in the same cycle."""
        if self._cycle % self._stride == 0 and self._goals:
            self._goals[-1] = np.array(goal_rad)

    def diagnosed(self, rows: Sequence[DiagnosticStatus]) -> None:
        """Adds temperatures, with the time of the newest sample."""
        if not self._stamps_ns:
            return
        for row in rows:
            self._load_is_fraction |= "load" in row.values
            text = row.values.get("temperature_c")
            if text is not None:
                series = self._temperatures.setdefault(row.name, [])
                series.append((self._stamps_ns[-1], float(text)))
                if len(series) > MOST_TEMPERATURES:
                    del series[1::2]

    def results(self) -> list[Result]:
        """Rows of the table: lag, load and temperature, as far as they are known."""
        rows: list[Result] = []
        lag_s = self.lag_s()
        if lag_s is not None:
            rows.append(("lag", True, f"{lag_s * 1e3:.0f} ms behind the goal"))
        if any(goal is not None for goal in self._goals):
            most = float(np.abs(np.array(self._efforts)).max(initial=0.0))
            text = f"{most:.0%} of stall torque" if self._load_is_fraction else f"{most:.3g}"
            rows.append(("load", True, f"{text} at most"))
        values = [value for series in self._temperatures.values() for _, value in series]
        if values:
            low, high = round(min(values)), round(max(values))
            rows.append(("temperature", True, f"{low} °C" if low == high else f"{low} to {high} °C"))
        return rows

    def lag_s(self) -> float | None:
        """The lag of the slowest joint behind its goal; None if no joint moved."""
        first, last = self._commanded()
        if last - first < 8:
            return None
        goals = np.array([goal for goal in self._goals[first:last] if goal is not None])
        positions = np.array(self._positions[first:last])
        period_s = (self._stamps_ns[last - 1] - self._stamps_ns[first]) / (last - first - 1) / 1e9
        moved = np.ptp(goals, axis=0) >= MOVES_RAD
        if not moved.any() or period_s <= 0:
            return None
        most = min(round(LAG_MAX_S / period_s), len(goals) // 2)
        lags = [_lag(goals[:, joint], positions[:, joint], most) for joint in np.flatnonzero(moved)]
        return max(lags) * period_s

    def traces(self, names: Sequence[str]) -> list[JointTrace]:
        """The series of each joint; empty if nothing was recorded."""
        if not self._stamps_ns:
            return []
        start_ns = self._stamps_ns[0]
        shown = slice(None, None, -(-4 * len(self._stamps_ns) * len(names) // MOST_VALUES) or 1)
        times = tuple(round((stamp - start_ns) / 1e9, 4) for stamp in self._stamps_ns[shown])
        return [
            JointTrace(
                joint=name,
                time_s=times,
                goal_rad=tuple(None if goal is None else _number(goal[joint]) for goal in self._goals[shown]),
                position_rad=tuple(_number(position[joint]) for position in self._positions[shown]),
                effort=tuple(_number(effort[joint]) for effort in self._efforts[shown]),
                temperature_c=tuple(
                    (round((stamp - start_ns) / 1e9, 3), value)
                    for stamp, value in self._temperatures.get(name, ())
                ),
            )
            for joint, name in enumerate(names[: self._positions[0].size])
        ]

    def _commanded(self) -> tuple[int, int]:
        """The longest stretch in which every cycle wrote a goal."""
        best = (0, 0)
        start = 0
        for index, goal in enumerate([*self._goals, None]):
            if goal is None:
                if index - start > best[1] - best[0]:
                    best = (start, index)
                start = index + 1
        return best

    def _thin_out(self) -> None:
        self._stride *= 2
        for series in (self._stamps_ns, self._positions, self._efforts, self._goals):
            del series[1::2]


def _lag(goal: FloatArray, position: FloatArray, most: int) -> float:
    """The lag of a position behind its goal in samples: the least difference, refined by a parabola."""
    shifts = range(max(1, most))
    errors = np.array([np.mean((position[shift:] - goal[: goal.size - shift]) ** 2) for shift in shifts])
    best = int(errors.argmin())
    if not 0 < best < errors.size - 1:
        return float(best)
    before, at, after = errors[best - 1 : best + 2]
    curve = before - 2 * at + after
    return best + (0.5 * (before - after) / curve if curve > 0 else 0.0)


def _number(value: float) -> float:
    return round(float(value), 5) if math.isfinite(value) else 0.0


#: Root mean square of the distance between goal and position that still counts as following.
TRACKING_ERROR_MAX_RAD = 0.1

#: Distance beyond a limit that gear backlash explains.
RANGE_TOLERANCE_RAD = 0.05


class ActuatorTest:
    """Collects the figures of one actuator.

    Args:
        spec: the node's part of the plan.
    """

    def __init__(self, spec: NodeSpec) -> None:
        self._spec = spec
        self._states = 0
        self._goal: FloatArray | None = None
        self._squares = 0.0
        self._largest_rad = 0.0
        self._samples = 0
        self._outside_rad = 0.0
        self._finite = True
        self._recorder = MotionRecorder() if spec.facts.testing else None

    def state(self, reading: JointReading, limits: JointLimits) -> None:
        """Adds a state and compares it with the goal of the previous cycle."""
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
        """Adds a written goal. Only goals that follow commands count for the tracking error."""
        self._goal = goal_rad if following else None
        if self._recorder is not None:
            self._recorder.written(goal_rad)

    def diagnosed(self, rows: Sequence[DiagnosticStatus]) -> Sequence[DiagnosticStatus]:
        """Adds the rows of the device's diagnostics and returns them."""
        if self._recorder is not None:
            self._recorder.diagnosed(rows)
        return rows

    def traces(self) -> list[JointTrace]:
        """The recordings of MODE_TEST, one trace for each joint."""
        names = [joint.name for joint in self._spec.facts_as(ActuatorFacts).joints]
        return self._recorder.traces(names) if self._recorder is not None else []

    def results(self, commands: Sequence[tuple[CommandReader, TrafficFigures]]) -> list[Result]:
        """The rows of the table about positions and commands."""
        rows: list[Result] = []
        if not self._finite:
            rows.append(("positions", False, "a position was not a finite number"))
        elif self._states:
            inside = self._outside_rad <= RANGE_TOLERANCE_RAD
            text = "within the limits" if inside else f"up to {self._outside_rad:.3f} rad beyond the limits"
            rows.append(("positions", inside, text))
        for reader, figures in commands:
            text = f"{reader.accepted} at {figures.rate_hz:.4g} Hz"
            text += f", {reader.refused} refused" if reader.refused else ""
            rows.append((f"commands on {reader.topic}", reader.accepted > 0 and not reader.refused, text))
        rows += self._tracking(bool(commands))
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
