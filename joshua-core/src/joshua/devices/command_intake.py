"""From the messages of a command topic to goals: whose turn it is, what the message says, what follows."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable
from enum import Enum
from typing import Any

import numpy as np

from joshua.devices.actuator import FloatArray
from joshua.devices.errors import DeviceError
from joshua.devices.goal import GoalGenerator, GoalState
from joshua.devices.joint_command import CommandReader
from joshua.devices.mapping import LeaderMapping
from joshua.node.context import NodeContext
from joshua.plan import ActuatorFacts, Commander, OnStale

NS_PER_S = 1_000_000_000

#: Silence of the override publisher after which the others' commands count again.
RELEASED_AFTER_S = 0.5


class Turn(Enum):
    """What a command is worth."""

    OURS = "ours"
    """It comes from the one who commands."""
    FIRST = "first"
    """So it does, and its publisher has just come to command: the joints must approach it slowly."""
    NOT_OURS = "not ours"
    """Somebody else commands; it is to be ignored."""


class TakeOver:
    """Decides between the publishers that command one actuator.

    Args:
        overriding: full names of the nodes that take over.
        log: where a change of hands is reported.
        released_after_s: silence of the overriding node after which the others command again.
    """

    def __init__(
        self, overriding: Iterable[str], log: Any, *, released_after_s: float = RELEASED_AFTER_S
    ) -> None:
        self._overriding = frozenset(overriding)
        self._log = log
        self._released_after_s = released_after_s
        # two topics can command one actuator, each on a thread of its own
        self._lock = threading.Lock()
        self._holder = ""
        self._until_ns = 0

    def turn(self, publisher: str, now_ns: int, lasts_s: float = 0.0) -> Turn:
        """Whether a command counts.

        Args:
            publisher: full name of the node that sent it.
            now_ns: on the monotonic clock.
            lasts_s: how long the command goes on by itself; a trajectory plays that long.
        """
        with self._lock:
            if publisher in self._overriding:
                return self._override(publisher, now_ns, lasts_s)
            if not self._holder:
                return Turn.OURS
            if now_ns < self._until_ns:
                return Turn.NOT_OURS
            self._log.info(
                "%s has been silent for %g s: other commands count again",
                self._holder,
                self._released_after_s,
            )
            self._holder = ""
            return Turn.FIRST

    def _override(self, publisher: str, now_ns: int, lasts_s: float) -> Turn:
        first = self._holder != publisher
        if first:
            self._log.warning("%s takes over: commands of others are ignored while it sends", publisher)
        self._holder = publisher
        self._until_ns = now_ns + round((lasts_s + self._released_after_s) * NS_PER_S)
        return Turn.FIRST if first else Turn.OURS


PARK = "PARK_THEN_RELEASE"

#: A joint this close to its park pose has arrived; about what gravity takes from a servo of a desk arm.
ARRIVED_RAD = 0.05


class StalePolicy:
    """The policy of one actuator that does not hold for ever.

    Args:
        goals: of the actuator; they park it.
        policy: what they do, and when.
    """

    def __init__(self, goals: GoalGenerator, policy: OnStale) -> None:
        self._goals = goals
        self._action, self._after_s, self._timeout_s = policy.action, policy.after_s, policy.timeout_s
        self._pose = np.array(policy.pose_rad, np.float64)
        self._state = GoalState.WAITING
        self._since_s = 0.0

    def look(self, position_rad: FloatArray, now_s: float) -> str:
        """Takes the state of a control cycle; returns why the torque must go now, "" while it need not."""
        state = self._goals.state if self._goals.stale else GoalState.FOLLOWING
        if state is not self._state:
            self._state, self._since_s = state, now_s
        elapsed_s = now_s - self._since_s
        if state is GoalState.HOLDING and elapsed_s >= self._after_s:
            if self._action != PARK:
                return f"no command came back within {self._after_s:g} s, so the torque was taken off"
            self._goals.park(self._pose)
        if state is GoalState.PARKING:
            if np.abs(position_rad - self._goals.limits.clip(self._pose)).max() < ARRIVED_RAD:
                return "no command came back, so the joints were parked and their torque was taken off"
            if elapsed_s >= self._timeout_s:
                return (
                    "no command came back, so the torque was taken off; the park pose was not reached within "
                    f"{self._timeout_s:g} s"
                )
        return ""


class CommandIntake:
    """What runs on a transport thread for each message of one command topic.

    Args:
        reader: of the topic.
        goals: get the commands.
        take_over: decides between publishers; None where none is declared as override.
    """

    def __init__(self, reader: CommandReader, goals: GoalGenerator, take_over: TakeOver | None) -> None:
        self._reader, self._goals, self._take_over = reader, goals, take_over

    def joint_state(self, message: Any, received_ns: int, publisher: str = "") -> None:
        """Takes a JointState."""
        del received_ns  # the watchdog needs the monotonic clock
        now_ns = time.monotonic_ns()
        if not self._has_turn(publisher, now_ns, 0.0):
            return
        if (command := self._reader.joint_state(message, publisher)) is not None:
            self._goals.command(command, now_ns)

    def trajectory(self, message: Any, received_ns: int, publisher: str = "") -> None:
        """Takes a JointTrajectory."""
        del received_ns
        now_ns = time.monotonic_ns()
        trajectory = self._reader.trajectory(message, publisher)
        lasts_s = trajectory.duration_s if trajectory is not None and len(trajectory.time_s) else 0.0
        if self._has_turn(publisher, now_ns, lasts_s) and trajectory is not None:
            self._goals.play(trajectory, now_ns)

    def _has_turn(self, publisher: str, now_ns: int, lasts_s: float) -> bool:
        if self._take_over is None:
            return True
        turn = self._take_over.turn(publisher, now_ns, lasts_s)
        if turn is Turn.FIRST:
            self._goals.approach()
        return turn is not Turn.NOT_OURS


def leader_mappings(context: NodeContext, topic: str) -> dict[str, LeaderMapping]:
    """The mapping of each leader that publishes on a command topic, by the full name of its node.

    Raises:
        DeviceError: leader and follower cannot be paired.
    """
    facts = context.spec.facts_as(ActuatorFacts)
    return {
        leader.node: _mapping(context, facts, leader)
        for leader in facts.commanders
        if leader.topic == topic and leader.joints is not None
    }


def _mapping(context: NodeContext, facts: ActuatorFacts, leader: Commander) -> LeaderMapping:
    own_name = context.spec.full_name
    try:
        mapping = LeaderMapping(leader.joints or (), facts.joints)
    except ValueError as error:
        raise DeviceError(f"{own_name} cannot follow {leader.node}: {error}") from error
    pairs = ", ".join(f"{pair.leader} → {pair.follower}" for pair in mapping.pairs)
    context.log.info("follows %s: %s", leader.node, pairs)
    unpaired = mapping.unpaired_leader + mapping.unpaired_follower
    if unpaired:
        context.warn(
            f"{own_name} and {leader.node} differ in their joints; without partner: {', '.join(unpaired)}"
        )
    return mapping
