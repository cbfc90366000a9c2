"""Base class of the gamepad and keyboard nodes: joints, commands, help."""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from joshua.api import ConfigurationError, DiagnosticStatus, NodeContext
from joshua.api.nodes import DiagnosticsPublisher, MessagePublisher, NodeBehaviour, SensorFacts
from joshua.messages.make import joint_state
from joshua.tools import nearest_first

from joshua_teleop_input.drive import Drive, limits_of
from joshua_teleop_input.gate import Gate
from joshua_teleop_input.jog import Jog
from joshua_teleop_input.settings import JOINT_STATE, InputSettings

JOY = "sensor_msgs/msg/Joy"

#: Time without a sign of life of the reader thread after which all controls count as released.
READER_LIMIT_S = 0.5

#: Rate of goals if the node publishes none, for the displayed state.
_IDLE_RATE_HZ = 20.0


class InputNode(NodeBehaviour):
    """Drives joints from user input.

    A reader thread passes states to ``take``. A command is published at once when a motion starts or ends,
    and at the rate of its topic while driving is on.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._lock = threading.Lock()
        self._drive: Drive | None = None
        self._commands: list[MessagePublisher] = []
        self._joys: list[MessagePublisher] = []
        self._shown = ""
        self._waiting_since_s: float | None = None
        self._commanded = 0
        self._read_s = float("inf")
        self._trouble = ""
        self._diagnostics: DiagnosticsPublisher | None = None

    @property
    def drive(self) -> Drive:
        """Drive of the joints."""
        assert self._drive is not None
        return self._drive

    def set_up(
        self, settings: InputSettings, gate: Gate, shape: Callable[[float], float], release: str
    ) -> None:
        """Declare topics and prepare the drive. Raises ConfigurationError."""
        spec = self.context.spec
        known = spec.facts_as(SensorFacts).joints
        self._refuse_unknown_joints(settings, [joint.name for joint in known])
        topics = [topic for topic in spec.publishers if topic.type_name == JOINT_STATE]
        rate_hz = max((topic.rate_hz for topic in topics), default=_IDLE_RATE_HZ)
        joints = [control.joint for control in settings.controls] if topics else []
        self._drive = Drive(
            settings.controls, gate, Jog(joints, limits_of(known), 1.0 / rate_hz), shape, release
        )
        # Without a rate, because they are silent while driving is off.
        unpaced = [topic.model_copy(update={"rate_hz": 0.0}) for topic in topics]
        self._commands = [self.context.publisher(topic) for topic in unpaced]
        self._joys = [self.context.publisher(topic) for topic in spec.publishers if topic.type_name == JOY]
        if joints:
            for topic in spec.subscriptions:
                self.context.subscribe(topic, self._hear_state)
            self.context.create_timer(1.0 / rate_hz, self._tick, name="commands")
        for publisher in self._joys:
            call = functools.partial(self.publish_joy, publisher)
            self.context.create_timer(1.0 / publisher.topic.rate_hz, call, name="joy")
        if joints:
            self.context.create_timer(0.1, self._show, name="help")
        self._diagnostics = DiagnosticsPublisher(self.context, self._diagnostic_rows)
        self._diagnostics.start()

    def reads(self, trouble: str = "") -> None:
        """Record a sign of life of the reader thread on each cycle; ``trouble`` is shown to the user."""
        self._read_s = time.monotonic()
        self._trouble = trouble

    def publish_joy(self, publisher: MessagePublisher) -> None:
        """Publish the present state as a Joy."""

    def take(self, value: Callable[[str], float]) -> None:
        """Process a device state, on the reader thread."""
        with self._lock:
            if self.drive.take(value):
                self._command()
            if self.drive.returns_control:
                self.drive.returns_control = False
                self.context.log.info("control is returned to the other commander")
                for publisher in self._commands:  # an empty message returns control
                    publisher.publish(joint_state([], []))

    def release(self) -> bool:
        """Treat all controls as released and switch driving off. Return whether it was on."""
        with self._lock:
            was = self.drive.release()
            self._command()
        return was

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Return the rates of the Joys and the number of commands."""
        rows = [joy.figures.check() for joy in self._joys]
        return [*rows, *([("commands", True, f"{self._commanded} sent")] if self._commands else [])]

    def _tick(self) -> None:
        with self._lock:
            if time.monotonic() - self._read_s > READER_LIMIT_S and self.drive.release():
                self.context.log.warning("the node is not reading the device: all controls count as released")
            self._command()

    def _diagnostic_rows(self) -> list[DiagnosticStatus]:
        """Return one diagnostics row: whether the device is connected and driving is on."""
        spec = self.context.spec
        values = {"driving": self.drive.gate.describe(), "commands": str(self._commanded)}
        level = DiagnosticStatus.ERROR if self._trouble else DiagnosticStatus.OK
        return [
            DiagnosticStatus(level, "", self._trouble or "in order", f"{spec.plugin} {spec.block}", values)
        ]

    def _command(self) -> None:
        """Publish the goals while driving is on. The caller holds the lock."""
        goals = self.drive.command(time.monotonic())
        if goals is None or not self._commands:
            return
        message = joint_state(list(goals), list(goals.values()), frame_id=self.context.spec.frame_id)
        for publisher in self._commands:
            publisher.publish(message)
        self._commanded += 1

    def _hear_state(self, message: Any, received_ns: int) -> None:
        del received_ns  # goals are planned on the monotonic clock
        names, angles = list(message.name), [float(angle) for angle in message.position]
        with self._lock:
            jog = self.drive.jog
            first = bool(jog.missing())
            jog.observe(dict(zip(names, angles, strict=False)), time.monotonic())
            missing = jog.missing() if first else []
        if missing:
            self.context.fail(
                f"no joint is named {', '.join(missing)}: the joint state received has "
                f"{', '.join(nearest_first(missing[0], names)) or 'no joints'}; correct joint in controls"
            )

    def _refuse_unknown_joints(self, settings: InputSettings, known: list[str]) -> None:
        for control in settings.controls:
            if known and settings.drives and control.joint not in known:
                raise ConfigurationError(
                    f"{self.context.spec.full_name}: no joint is named {control.joint!r}; the actuator has "
                    f"{', '.join(nearest_first(control.joint, known))}: correct joint in controls"
                )

    # Display for the user.

    def _show(self) -> None:
        """Show the state in the status line and log its changes."""
        with self._lock:
            drive, now_s = self.drive, time.monotonic()
            state = drive.gate.describe()
            moving = drive.moving
            waits = bool(self._commands) and drive.gate.active and not drive.jog.ready(now_s)
        if waits:
            self._waiting_since_s = self._waiting_since_s or now_s
            if now_s - self._waiting_since_s > 0.5:
                state = "waiting for a joint state of the arm"
        else:
            self._waiting_since_s = None
        if state != self._shown:
            first, self._shown = not self._shown, state
            if not (first and state == "ON"):
                self.context.log.info("driving is %s", state)
        self.context.show(f"driving {state}{_speeds(moving)}")


def _speeds(moving: Mapping[str, float]) -> str:
    parts = [f"{joint} {'+' if speed > 0 else '-'}" for joint, speed in moving.items()]
    return f": {', '.join(parts)}" if parts else ""
