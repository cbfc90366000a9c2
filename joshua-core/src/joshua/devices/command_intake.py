"""Turns messages of a command topic into goals: selects the commander and reads its messages."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from joshua.devices.errors import ConfigurationError
from joshua.devices.goal import GoalGenerator
from joshua.devices.joint_command import CommandReader, LeaderMapping, shown_publisher
from joshua.node.cadence import TrafficFigures
from joshua.node.context import NodeContext
from joshua.node.writers import Writer
from joshua.plan import ActuatorFacts, Commander, TopicSpec

JOINT_STATE = "sensor_msgs/msg/JointState"
JOINT_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"

NS_PER_S = 1_000_000_000

#: Time without a message of an override after which the joints hold. Checked every 50 ms.
OVERRIDE_LOST_AFTER_S = 0.2

#: Time without a message of a commander after which another permitted one may command.
FREE_AFTER_S = 0.5

# names come from outside, so the table is bounded
_MOST_PUBLISHERS = 100


class Commanders:
    """Decides whose commands one actuator executes: one commander at a time.

    The plan names who may command; on an external topic any node may. The first to publish has control until
    it has not published for ``FREE_AFTER_S``. An override takes control at once, a leader arm once it has
    moved, and keeps it: if it stops, the joints hold until ``release`` returns control or the override
    publishes again. Every other command is refused. The commander is a writer, so that it stays the same when
    the name of its node arrives after its first messages. A command is read after ``permits`` and before
    ``take_control``, so an invalid one changes nothing. Hold ``lock`` from the decision to the action,
    because commands arrive on several threads.

    Args:
        commanders: those named by the plan; external: topics on which others may publish.
        goals: of the actuator.
        log: where refusals and changes of control are reported.

    Attributes:
        overriding: it is an override; held: the override has stopped publishing.
        overrides: full names and topics of the overrides.
        refused: number of refused commands, by the name of the publisher.
        ignored: number of valid commands that had no effect since the last fault began, in the same way.
    """

    def __init__(
        self, commanders: Iterable[Commander], external: Iterable[str], goals: GoalGenerator, log: Any
    ) -> None:
        commanders = tuple(commanders)
        self._named = {(named.node, named.topic): named.override for named in commanders}
        self.overrides = frozenset(key for key, override in self._named.items() if override)
        self._motion_rad = {
            (named.node, named.topic): named.motion_rad for named in commanders if named.motion_rad
        }
        self._rest: dict[tuple[str, str], tuple[tuple[str, ...], tuple[float, ...]]] = {}
        self._external = frozenset(external)
        self._topics_of_named = {named.topic for named in commanders}
        self._goals = goals
        self._log = log
        self._until_ns = 0
        self.lock = threading.Lock()
        self._current: Writer | None = None
        self.overriding = self.held = False
        self.refused: dict[str, int] = {}
        self.ignored: dict[str, int] = {}

    @property
    def current(self) -> str | None:
        """Full name of the commander; "" for one without a known node, None if there is none."""
        return None if self._current is None else self._current.name

    def is_current(self, writer: Writer) -> bool:
        """Whether a publisher belongs to the commander."""
        return writer.same_node(self._current)

    def permits(self, writer: Writer, topic: str, now_ns: int) -> bool:
        """Whether a publisher may command at present, with the lock held. ``now_ns`` is monotonic.

        Changes nothing but the number of refused commands. A publisher whose name may still arrive waits
        where its name decides, and is not counted as refused.
        """
        if writer.awaits_name and self._is_judged_by_name(topic):
            return False
        override = self._named.get((writer.name, topic))
        if override is None and topic not in self._external:
            return self._refuse(
                writer,
                topic,
                "the configuration does not name it as a commander. To accept commands from outside the "
                "file, set external: true on this subscription",
            )
        if self.overriding and not override:
            return False
        is_free = now_ns >= self._until_ns
        if override or is_free or self.is_current(writer):
            return True
        if writer.awaits_name:  # its node may prove to be the commander
            return False
        return self._refuse(writer, topic, f"{shown_publisher(self.current)} is the commander")

    def _is_judged_by_name(self, topic: str) -> bool:
        """Whether the plan names the commanders of a topic, or one of them where others may publish, too."""
        return topic not in self._external or topic in self._topics_of_named

    def take_control(self, writer: Writer, topic: str, now_ns: int, lasts_s: float = 0.0) -> None:
        """Makes a permitted publisher the commander, with the lock held, because its command is executed.

        Args:
            writer: the publisher; topic: of its command; now_ns: monotonic.
            lasts_s: time for which the command continues by itself, such as a trajectory.
        """
        override = self.is_override(writer, topic)
        if not self.is_current(writer) or self.held or override != self.overriding:
            self._goals.approach()
            if override:
                self._log.warning(
                    "%s overrides: commands of other nodes are ignored", shown_publisher(writer.name)
                )
        self._current, self.overriding, self.held = writer, override, False
        self._await_next(writer, topic, now_ns, lasts_s)

    def ignore(self, writer: Writer, topic: str, now_ns: int, reason: str) -> None:
        """Counts a valid command that has no effect, and names its publisher once for each fault.

        The lock is held. Nobody takes control, but the commander counts as publishing.

        Args:
            writer: the publisher; topic: of its command; now_ns: monotonic.
            reason: the fault, and how to end it.
        """
        if self.is_current(writer) and not self.held:
            self._await_next(writer, topic, now_ns)
        if writer.awaits_name:
            return
        if _count(self.ignored, writer.name):
            self._log.warning(
                "%s: commands from %s have no effect: %s", topic, shown_publisher(writer.name), reason
            )

    def forget_ignored(self) -> None:
        """Starts to count ignored commands anew, because a fault begins or has ended."""
        with self.lock:
            self.ignored.clear()

    def _await_next(self, writer: Writer, topic: str, now_ns: int, lasts_s: float = 0.0) -> None:
        """Sets the time until which the commander counts as publishing."""
        silence_s = OVERRIDE_LOST_AFTER_S if self.is_override(writer, topic) else FREE_AFTER_S
        self._until_ns = now_ns + round((silence_s + lasts_s) * NS_PER_S)

    def is_override(self, writer: Writer, topic: str) -> bool:
        """Whether the plan names the node of a publisher as an override on a topic."""
        return (writer.name, topic) in self.overrides

    def is_at_rest(self, writer: Writer, topic: str, message: Any) -> bool:
        """Whether a leader that may override has not moved since another got control; the lock is held.

        Args:
            writer: the publisher; topic: of its command.
            message: a JointState that can be executed. The first one becomes the rest position.
        """
        key = (writer.name, topic)
        least_rad = self._motion_rad.get(key, 0.0)
        if not least_rad or (self.overriding and self.is_current(writer)):
            return False
        names, positions = tuple(message.name), tuple(map(float, message.position))
        rest_names, rest = self._rest.setdefault(key, (names, positions))
        if rest_names != names:
            self._rest[key] = names, positions
            return True
        moved_rad = (abs(position - start) for position, start in zip(positions, rest, strict=True))
        # joints that the follower lacks are not checked, so theirs may be NaN or infinite
        return not any(math.isfinite(distance) and distance > least_rad for distance in moved_rad)

    @property
    def releasable(self) -> bool:
        """Whether the override can be released while it publishes: it takes control again by moving only."""
        return self.held or any(node == self.current for node, _ in self._motion_rad)

    def watch(self, now_ns: int) -> None:
        """Holds the joints if the override has stopped publishing; call it every 50 ms."""
        with self.lock:
            if self.overriding and not self.held and now_ns > self._until_ns:
                self.held = True
                self._goals.hold()
                self._log.warning(
                    "the override %s stopped publishing: the joints hold their position. Press its release "
                    "button or run `joshua call NODE release_override` to return control",
                    shown_publisher(self.current),
                )

    def release(self) -> str:
        """Ends the override. Returns the name of its node, "" if there is none.

        The next commander is approached slowly.
        """
        with self.lock:
            return self.release_locked()

    def release_locked(self) -> str:
        """The same; the lock is held."""
        if not self.overriding:
            return ""
        name = shown_publisher(self.current)
        self._current, self._until_ns = None, 0
        self.overriding = self.held = False
        self._rest.clear()
        self._goals.hold()
        self._log.warning("the override %s is released: other commanders have control again", name)
        return name

    @property
    def shown(self) -> str:
        """The state for the status line; "" if there is nothing to report."""
        parts = []
        if self.overriding:
            state = "stopped publishing: holding" if self.held else "commands"
            parts.append(f"override {shown_publisher(self.current)} {state}")
        ignored, refused = dict(self.ignored), dict(self.refused)
        if ignored:
            parts.append(f"{sum(ignored.values())} commands without effect from {_names(ignored)}")
        if refused:
            parts.append(f"{sum(refused.values())} commands refused from {_names(refused)}")
        return "; ".join(parts)

    def _refuse(self, writer: Writer, topic: str, why: str) -> bool:
        if _count(self.refused, writer.name):
            self._log.warning(
                "%s: commands from %s are refused: %s", topic, shown_publisher(writer.name), why
            )
        return False


def _count(counts: dict[str, int], publisher: str) -> bool:
    """Counts a command of a publisher in a bounded table. Returns whether it is the publisher's first."""
    known = publisher in counts or len(counts) < _MOST_PUBLISHERS
    name = publisher if known else ""
    counts[name] = counts.get(name, 0) + 1
    return known and counts[name] == 1


def _names(publishers: Iterable[str]) -> str:
    names = [shown_publisher(publisher) for publisher in publishers]
    return ", ".join(names[:3]) + (", …" if len(names) > 3 else "")


def _no_fault() -> str:
    return ""


class CommandIntake:
    """Handles the messages of the command topics of one actuator, on transport threads.

    Args:
        context: of its node.
        goals: get the commands.
        commanders: decide whose commands are executed.
        arrived: called with the monotonic time of each executed joint state.
        fault: returns why commands have no effect at present, and what ends that; "" if they have.
    """

    def __init__(
        self,
        context: NodeContext,
        goals: GoalGenerator,
        commanders: Commanders,
        arrived: Callable[[int], None],
        fault: Callable[[], str] = _no_fault,
    ) -> None:
        self._context, self._goals, self._commanders, self._arrived = context, goals, commanders, arrived
        self._fault = fault

    def subscribe(self, topic: TopicSpec, joints: Sequence[str]) -> tuple[CommandReader, TrafficFigures]:
        """Subscribes to a topic; ``joints`` in joint order. Raises ConfigurationError for an unfit leader."""
        facts = self._context.spec.facts_as(ActuatorFacts)
        mappings = {
            leader.node: _mapping(self._context, facts, leader)
            for leader in facts.commanders
            if leader.topic == topic.name and leader.joints is not None
        }
        reader = CommandReader(topic.name, joints, self._context.log, mappings, self._goals.limits)
        handle = self.joint_state if topic.type_name == JOINT_STATE else self.trajectory

        def take(message: Any, received_ns: int, writer: Writer) -> None:
            del received_ns  # the watchdog needs the monotonic clock
            handle(reader, message, writer)

        return reader, self._context.subscribe_with_writer(topic, take)

    def joint_state(self, reader: CommandReader, message: Any, publisher: Writer | str) -> None:
        """Handles a JointState. An empty one releases the override that sends it.

        Args:
            reader: of its topic; message: the JointState.
            publisher: of the message, or the full name of a known node.
        """
        now_ns, commanders, writer = time.monotonic_ns(), self._commanders, _writer(publisher)
        with commanders.lock:
            is_empty = not len(message.name) and not len(message.position)
            if is_empty and commanders.is_override(writer, reader.topic):
                if commanders.is_current(writer):
                    commanders.release_locked()
                return
            if not commanders.permits(writer, reader.topic, now_ns):
                return
            command = reader.joint_state(message, writer.name)
            if command is None or commanders.is_at_rest(writer, reader.topic, message):
                return
            if fault := self._fault():
                commanders.ignore(writer, reader.topic, now_ns, fault)
                return
            commanders.take_control(writer, reader.topic, now_ns)
            self._goals.command(command, now_ns)
        self._arrived(now_ns)

    def trajectory(self, reader: CommandReader, message: Any, publisher: Writer | str) -> None:
        """Handles a JointTrajectory; arguments as for ``joint_state``."""
        now_ns, commanders, writer = time.monotonic_ns(), self._commanders, _writer(publisher)
        with commanders.lock:
            if not commanders.permits(writer, reader.topic, now_ns):
                return
            trajectory = reader.trajectory(message, writer.name)
            if trajectory is None:
                return
            if fault := self._fault():
                commanders.ignore(writer, reader.topic, now_ns, fault)
                return
            commanders.take_control(writer, reader.topic, now_ns, trajectory.duration_s)
            self._goals.play(trajectory, now_ns)


def _writer(publisher: Writer | str) -> Writer:
    return Writer.of_node(publisher) if isinstance(publisher, str) else publisher


def _mapping(context: NodeContext, facts: ActuatorFacts, leader: Commander) -> LeaderMapping:
    own_name = context.spec.full_name
    try:
        mapping = LeaderMapping(leader.joints or (), facts.joints)
    except ValueError as error:
        raise ConfigurationError(f"{own_name} cannot follow {leader.node}: {error}") from error
    names = [(pair.leader, pair.follower) for pair in mapping.pairs]
    pairs = ", ".join(name if name == own else f"{name} → {own}" for name, own in names)
    context.log.info("follows %s: %s", leader.node, pairs)
    unpaired = mapping.unpaired_leader + mapping.unpaired_follower
    if unpaired:
        context.warn(f"{own_name} and {leader.node} have different joints; unpaired: {', '.join(unpaired)}")
    return mapping
