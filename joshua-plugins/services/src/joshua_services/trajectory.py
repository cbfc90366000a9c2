"""Action FollowJointTrajectory of an actuator that takes commands from outside the file.

The server publishes the trajectory on the actuator's own external topic, so that limits, ramp, watchdog and
the rule of one commander hold as for every other commander.
"""

from __future__ import annotations

import threading
import time
from itertools import pairwise
from typing import Any

import numpy as np
from joshua.api import JointRange
from joshua.api.nodes import ActuatorFacts, ExtendedNode
from joshua.api.transports import QosProfile, Sample
from joshua.messages import decode, encode, message_class

from joshua_services.action_server import ABORTED, CANCELED, SUCCEEDED, ActionServer, Goal
from joshua_services.action_types import ACTION, define_types

JOINT_STATE = "sensor_msgs/msg/JointState"
JOINT_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
NAME = "follow_joint_trajectory"

#: Default of a goal's tolerance of each joint at its last point: a desk arm sags by less.
GOAL_TOLERANCE_RAD = 0.1
#: Distance beyond a limit that counts as rounding.
LIMIT_TOLERANCE_RAD = 0.01
#: A first point at time 0 states where the joints are, and a joint may rest this far outside its limits.
START_TOLERANCE_RAD = 0.1
#: Default of the time after the last point within which the joints may still arrive.
GOAL_TIME_S = 2.0
#: Time within which the actuator must publish its state.
FIRST_STATE_S = 2.0
FEEDBACK_S = 0.05

# control_msgs/action/FollowJointTrajectory_Result
_SUCCESSFUL, _INVALID_GOAL, _INVALID_JOINTS, _PATH, _GOAL = 0, -1, -2, -4, -5


def trajectory_topic(node: ExtendedNode) -> str:
    """Return the topic for external trajectories to an actuator; "" if there is none."""
    spec = node.context.spec
    if not isinstance(spec.facts, ActuatorFacts):
        return ""
    topics = (topic for topic in spec.subscriptions if topic.type_name == JOINT_TRAJECTORY)
    return next((topic.name for topic in topics if topic.name in spec.facts.external), "")


class TrajectoryServer:
    """Server of ``NODE/follow_joint_trajectory`` of one actuator.

    Args:
        node: of the actuator; topic: on which it receives trajectories.
    """

    def __init__(self, node: ExtendedNode, topic: str) -> None:
        self._node = node
        define_types()
        planned = next(item for item in node.context.spec.subscriptions if item.name == topic)
        self._commands = node.handle.create_publisher(topic, JOINT_TRAJECTORY, planned.qos)
        self._lock = threading.Lock()
        self._arrived = threading.Event()
        self._position_rad: dict[str, float] = {}
        states = (item.name for item in node.context.spec.publishers if item.type_name == JOINT_STATE)
        self._state_topic = next(states, "")
        self._server = ActionServer(node, NAME, ACTION, self._refuse, self._execute)

    def _take_state(self, sample: Sample) -> None:
        message = decode(JOINT_STATE, sample.cdr)
        with self._lock:
            self._position_rad = dict(zip(message.name, map(float, message.position), strict=True))
        self._arrived.set()

    def _refuse(self, goal: Any) -> str:
        """Return why a goal is refused; "" if it can be executed, and may then replace a running one."""
        if not self._state_topic:
            return f"{self._node.context.spec.full_name} publishes no JointState"
        names, points = list(goal.trajectory.joint_names), list(goal.trajectory.points)
        facts = self._node.context.spec.facts_as(ActuatorFacts)
        known = [joint.name for joint in facts.joints]
        if len(goal.multi_dof_trajectory.joint_names) or len(goal.multi_dof_trajectory.points):
            return "multi_dof_trajectory is not empty; each joint here has one degree of freedom"
        if not names or not points:
            return "the trajectory has no joints or no points"
        if unknown := [name for name in names if known and name not in known]:
            return f"unknown joints {', '.join(unknown)}; the arm has {', '.join(known)}"
        if len(set(names)) < len(names):
            return "a joint is named twice"
        times_s = [_seconds(point.time_from_start) for point in points]
        if times_s[0] < 0 or any(later <= earlier for earlier, later in pairwise(times_s)):
            return "time_from_start is negative, or does not increase from point to point"
        for number, point in enumerate(points):
            if len(point.positions) != len(names) or not np.isfinite(point.positions).all():
                return f"point {number} needs a finite position for each of {len(names)} joints"
        return _outside(names, points, facts.joints) or self._node.context.fault_reason

    def _execute(self, goal: Goal) -> tuple[int, dict[str, Any]]:
        """Execute a goal; the joint state is subscribed to only meanwhile."""
        states = self._state_topic
        self._arrived.clear()
        qos = QosProfile(reliability="BEST_EFFORT", depth=1)
        subscription = self._node.handle.create_subscription(states, JOINT_STATE, qos, self._take_state)
        try:
            names = list(goal.request.trajectory.joint_names)
            if not self._arrived.wait(FIRST_STATE_S) or not np.isfinite(self._actual(names)).all():
                text = f"{states} does not have the state of each joint of the trajectory"
                return ABORTED, _result(_INVALID_JOINTS, text)
            return self._follow(goal, names)
        finally:
            subscription.close()

    def _follow(self, goal: Goal, names: list[str]) -> tuple[int, dict[str, Any]]:
        points = goal.request.trajectory.points
        start = self._actual(names)
        times_s = np.array([0.0, *(_seconds(point.time_from_start) for point in points)])
        wanted = np.vstack([start, *(point.positions for point in points)])
        path = _tolerances(goal.request.path_tolerance, names, 0.0)
        end = _tolerances(goal.request.goal_tolerance, names, GOAL_TOLERANCE_RAD)
        leeway_s = _seconds(goal.request.goal_time_tolerance) or GOAL_TIME_S
        self._commands.publish(encode(goal.request.trajectory))
        began_s, context = time.monotonic(), self._node.context
        while True:
            elapsed_s = time.monotonic() - began_s
            desired = np.array([np.interp(elapsed_s, times_s, column) for column in wanted.T])
            actual = self._actual(names)
            self._publish_feedback(goal, names, desired, actual, elapsed_s)
            if goal.cancel.is_set() or context.stopping:
                self._stop(names)
                if goal.replaced:
                    return ABORTED, _result(_INVALID_GOAL, "a newer goal replaced this one")
                return CANCELED, _result(_SUCCESSFUL, "the joints were stopped")
            if context.fault_reason:
                return ABORTED, _result(_INVALID_GOAL, context.fault_reason)
            off = np.abs(desired - actual)
            if (worst := _beyond(off, path)) is not None:
                self._stop(names)
                return ABORTED, _result(_PATH, _distance(names, off, path, worst, "path"))
            if elapsed_s >= times_s[-1]:
                worst = _beyond(off, end)
                if worst is None:
                    return SUCCEEDED, _result(_SUCCESSFUL, "")
                if elapsed_s >= times_s[-1] + leeway_s:
                    self._stop(names)
                    return ABORTED, _result(_GOAL, _distance(names, off, end, worst, "goal"))
            goal.cancel.wait(FEEDBACK_S)

    def _actual(self, names: list[str]) -> Any:
        with self._lock:
            return np.array([self._position_rad.get(name, np.nan) for name in names])

    def _stop(self, names: list[str]) -> None:
        """Stop the joints where they are, by a trajectory without points."""
        self._commands.publish(encode(message_class(JOINT_TRAJECTORY)(joint_names=names)))

    def _publish_feedback(
        self, goal: Goal, names: list[str], desired: Any, actual: Any, elapsed_s: float
    ) -> None:
        point = message_class("trajectory_msgs/msg/JointTrajectoryPoint")
        duration = message_class("builtin_interfaces/msg/Duration")
        seconds = int(elapsed_s)
        at = duration(sec=seconds, nanosec=int((elapsed_s - seconds) * 1e9))
        self._server.feedback(
            goal,
            {
                "joint_names": names,
                "desired": point(positions=desired, time_from_start=at),
                "actual": point(positions=actual, time_from_start=at),
                "error": point(positions=desired - actual, time_from_start=at),
            },
        )


def _outside(names: list[str], points: list[Any], joints: tuple[JointRange, ...]) -> str:
    """Return which position of a trajectory lies outside the joint's limits; "" if none does."""
    ranges = {joint.name: joint for joint in joints if joint.min_rad < joint.max_rad}
    for number, point in enumerate(points):
        is_start = number == 0 and len(points) > 1 and _seconds(point.time_from_start) == 0
        tolerance_rad = START_TOLERANCE_RAD if is_start else LIMIT_TOLERANCE_RAD
        for name, position_rad in zip(names, map(float, point.positions), strict=True):
            limits = ranges.get(name)
            if limits is None:
                continue
            beyond_rad = max(limits.min_rad - position_rad, position_rad - limits.max_rad)
            if beyond_rad > tolerance_rad:
                return (
                    f"point {number} commands {name} to {position_rad:.4g} rad, its limits are "
                    f"{limits.min_rad:.4g} to {limits.max_rad:.4g} rad. Plan within these limits"
                )
    return ""


def _seconds(duration: Any) -> float:
    return float(duration.sec + duration.nanosec * 1e-9)


def _tolerances(given: Any, names: list[str], default: float) -> Any:
    """Return the tolerance of each joint in rad; infinite without a limit."""
    named = {item.name: float(item.position) for item in given}
    found = np.array([named.get(name) or default for name in names])
    return np.where(found > 0, found, np.inf)  # 0 means no limit on the path, -1 removes one


def _beyond(off: Any, allowed: Any) -> int | None:
    """Return the joint furthest beyond its tolerance; None if none is."""
    excess = np.where(off > allowed, off - allowed, 0.0)
    return int(excess.argmax()) if excess.any() else None


def _distance(names: list[str], off: Any, allowed: Any, worst: int, what: str) -> str:
    return f"{names[worst]} is {off[worst]:.3f} rad from its {what}; the tolerance is {allowed[worst]:g} rad"


def _result(code: int, text: str) -> dict[str, Any]:
    return {"error_code": code, "error_string": text}
