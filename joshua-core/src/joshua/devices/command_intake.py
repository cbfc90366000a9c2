"""From the messages of a command topic to goals: whose turn it is, what the message says, what follows."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from joshua.devices.errors import DeviceError
from joshua.devices.goal import GoalGenerator
from joshua.devices.joint_command import CommandReader
from joshua.devices.mapping import LeaderMapping
from joshua.devices.take_over import TakeOver, Turn
from joshua.node.behaviour import NodeContext


class CommandIntake:
    """What runs on a transport thread for each message of one command topic.

    Args:
        reader: of the topic.
        goals: get the commands.
        take_over: decides between publishers; None where none is declared as override.
        count: called for each message.
    """

    def __init__(
        self,
        reader: CommandReader,
        goals: GoalGenerator,
        take_over: TakeOver | None,
        count: Callable[[], None],
    ) -> None:
        self._reader, self._goals, self._take_over, self._count = reader, goals, take_over, count

    def joint_state(self, message: Any, received_ns: int, publisher: str = "") -> None:
        """Takes a JointState."""
        del received_ns  # the watchdog needs the monotonic clock
        self._count()
        now_ns = time.monotonic_ns()
        if not self._has_turn(publisher, now_ns, 0.0):
            return
        if (command := self._reader.joint_state(message, publisher)) is not None:
            self._goals.command(command, now_ns)

    def trajectory(self, message: Any, received_ns: int, publisher: str = "") -> None:
        """Takes a JointTrajectory."""
        del received_ns
        self._count()
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
    facts = context.spec.context
    candidates = [facts.get("leader"), *facts.get("take_over", ())]
    leaders = [leader for leader in candidates if leader and leader["topic"] == topic and "joints" in leader]
    return {leader["node"]: _mapping(context, leader) for leader in leaders}


def _mapping(context: NodeContext, leader: dict[str, Any]) -> LeaderMapping:
    own_name = context.spec.full_name
    try:
        mapping = LeaderMapping(leader["joints"], context.spec.context["joints"])
    except ValueError as error:
        raise DeviceError(f"{own_name} cannot follow {leader['node']}: {error}") from error
    pairs = ", ".join(f"{pair.leader} → {pair.follower}" for pair in mapping.pairs)
    context.log.info("follows %s: %s", leader["node"], pairs)
    unpaired = mapping.unpaired_leader + mapping.unpaired_follower
    if unpaired:
        context.warn(
            f"{own_name} and {leader['node']} differ in their joints; without partner: {', '.join(unpaired)}"
        )
    return mapping
