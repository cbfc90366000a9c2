"""The node of an actuator: publishes its state, executes commands, leaves the joints in their safe state.

Why one file: one class, the life of an actuator from its configuration to its safe state.
"""

from __future__ import annotations

import time
from typing import Any

from joshua.devices.actuator import Actuator, FloatArray, JointReading
from joshua.devices.actuator_safety import ActuatorSafety
from joshua.devices.actuator_status import ActuatorStatus
from joshua.devices.actuator_test import ActuatorTest
from joshua.devices.arrivals import Arrivals
from joshua.devices.command_intake import JOINT_STATE, JOINT_TRAJECTORY, Commanders, CommandIntake
from joshua.devices.context import ActuatorContext
from joshua.devices.diagnostics import DiagnosticsPublisher, DiagnosticStatus
from joshua.devices.errors import ConfigurationError, DeviceError, SafetyTripped
from joshua.devices.goal import STALE_AFTER_S, GoalGenerator, GoalState, StalePolicy
from joshua.devices.joint_command import CommandReader
from joshua.guardian.order import BEAT_S
from joshua.messages import message_class
from joshua.messages.make import joint_state
from joshua.node.behaviour import NodeBehaviour
from joshua.node.cadence import TrafficFigures
from joshua.node.context import NodeContext
from joshua.node.endpoints import MessagePublisher, Outputs
from joshua.node.implementation import load_implementation
from joshua.node.timers import Timer
from joshua.node.verbs import RefusedError, verb
from joshua.plan import ActuatorFacts, JointTrace, TopicSpec

BOOL = "std_msgs/msg/Bool"

#: Rate of the control loop for an actuator without publishers.
CONTROL_RATE_HZ = 50.0


class ActuatorNode(NodeBehaviour):
    """The standard behaviour of actuators.

    One timer, at the rate of the fastest publisher, reads and publishes the state, then writes the newest
    command. The written goal is published on ``~/applied_command``. A leader, or an actuator without a
    commander, is only read and never gets torque.

    In a fault, it only reads until ``resume``, without enabling torque or writing. A fault follows a failure
    (``restarted`` in its facts; the torque stays as the safe state left it), a trip of a protection, an
    e-stop, or commands that stopped for longer than its policy allows (the torque is off). With a
    ``safe_stop`` in its facts, it has a guardian from before the joints get torque until they are in their
    safe state.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        spec = context.spec
        self._facts = spec.facts_as(ActuatorFacts)
        self._is_leader = spec.role == "ACTION_LEADER"
        states_hz = [topic.rate_hz for topic in spec.publishers if topic.type_name == JOINT_STATE]
        self._rate_hz = max(states_hz, default=CONTROL_RATE_HZ)
        self._arrivals = Arrivals(1 / self._rate_hz)
        self._cycle: Timer | None = None
        self._actuator: Actuator | None = None
        self._goals: GoalGenerator | None = None
        self._commands: list[tuple[CommandReader, TrafficFigures]] = []
        self._commanders: Commanders | None = None
        self._on_stale: StalePolicy | None = None
        self._outputs = Outputs(())
        self._written: MessagePublisher | None = None
        self._intervention: MessagePublisher | None = None
        self._energised = self._timer_runs = False
        self._last_state = GoalState.WAITING
        self._test = ActuatorTest(spec)
        self._safety = ActuatorSafety(context)
        self._status = ActuatorStatus(spec, 1 / self._rate_hz)
        self._stopped_by = ""
        self._diagnostics: DiagnosticsPublisher | None = None

    def configure(self) -> None:
        """Opens the device and declares topics. Raises DeviceError, TargetError."""
        spec = self.context.spec
        implementation, settings = load_implementation(spec, Actuator)
        actuator: Actuator = implementation(
            settings,
            ActuatorContext(
                self._facts,
                self.context.log,
                stopping=lambda: self.context.stopping,
                before_torque_off=self._safety.before_torque_off,
                remembered=self._safety.remembered(),
            ),
        )
        self._check_topics(actuator)
        self._actuator = actuator
        before = actuator.joint_names
        actuator.connect()
        self._check_joints(before, actuator.joint_names)
        self._safety.introduce(actuator)
        stale_after_s = self._facts.stale_after_s
        self._goals = GoalGenerator(
            actuator.limits,
            1 / self._rate_hz,
            stale_after_s=STALE_AFTER_S if stale_after_s is None else stale_after_s,
        )
        on_stale = self._facts.on_stale
        self._on_stale = StalePolicy(self._goals, on_stale) if on_stale else None
        self._outputs = Outputs(map(self.context.publisher, spec.publishers), self._rate_hz)
        if self._is_commanded and self._facts.keeps_last_goal:
            self.context.warn(
                f"{spec.full_name}: no safe stop: if this driver dies, the joints keep their last goal"
            )
        if self._is_commanded:
            self._written = self.context.publisher(
                TopicSpec(name="~/applied_command", type_name=JOINT_STATE, rate_hz=self._rate_hz)
            )
        if self._facts.intervention:
            self._intervention = self.context.publisher(
                TopicSpec(name="~/intervention", type_name=BOOL, rate_hz=self._rate_hz)
            )
        self._diagnostics = DiagnosticsPublisher(
            self.context, lambda: self._test.diagnosed(self._diagnosed(actuator))
        )
        if not self._is_leader:
            facts = self._facts
            self._commanders = Commanders(facts.commanders, facts.external, self._goals, self.context.log)
            intake = CommandIntake(
                self.context, self._goals, self._commanders, self._arrivals.arrived, self._ignores_commands
            )
            self._commands = [intake.subscribe(topic, actuator.joint_names) for topic in spec.subscriptions]

    def _ignores_commands(self) -> str:
        """Why commands have no effect; "" if they have. On a transport thread."""
        return "" if self._energised else self._status.fault

    def _check_joints(self, before: tuple[str, ...], after: tuple[str, ...]) -> None:
        """Refuses a driver whose joints differ from the plan's, or change when it connects."""
        planned = tuple(joint.name for joint in self._facts.joints) or before
        for names, whose in ((before, "before connect"), (planned, "in its settings")):
            if names != after:
                raise DeviceError(
                    f"{self.context.spec.full_name}: its joints changed: {', '.join(names)} {whose}, "
                    f"{', '.join(after)} once connected; this is a fault of the plugin "
                    f"{self.context.spec.plugin}"
                )

    def activate(self) -> None:
        """Energises the joints where they are, if they have a commander, and starts the control loop."""
        actuator, _ = self._device()
        if self._is_leader:
            self._safety.switch_off(actuator)  # a person moves it, even if an earlier run left it holding
        if self._safety.latch() is not None:
            self._watch()
        elif self._is_commanded and self._facts.restarted:
            left = self._safety.renew(actuator)
            self._enter_fault(f"restarted after a failure, {left}. Check the arm", "follow commands again")
        elif self._is_commanded:
            self.energise()
        if not self._timer_runs:
            self._timer_runs = True
            self._cycle = self.context.create_timer(1 / self._rate_hz, self._control, name="control")
            self.context.create_timer(BEAT_S, self._watch, name="safety")
            if self._diagnostics is not None:
                self._diagnostics.start()

    def energise(self) -> None:
        """Enables torque at the present positions. The joints then follow commands."""
        actuator, goals = self._device()
        actuator.prepare()  # a device that restarts for that may count differently, also for its guardian
        goals.seed(actuator.read().position_rad)
        self._safety.prepare_estop()
        self._safety.guard(actuator)
        self._safety.energising()
        # Whatever fails from here on requires the safe state.
        self._energised = self._safety.in_doubt = True
        actuator.enable()
        self._safety.in_doubt = False
        self._safety.beat()

    def estop(self) -> None:
        """Obeys an e-stop at once, without waiting for the next look at its file."""
        self._watch()

    def verb_providers(self) -> tuple[object, ...]:
        """The node's own verbs, those of its goals and those of its driver."""
        return tuple(one for one in (self, self._goals, self._actuator) if one is not None)

    @verb(moves=True, runs="activation")
    def resume(self) -> str:
        """End a fault: check the device as at the start, and energise it."""
        actuator, _ = self._device()
        name = self.context.spec.full_name
        if not self._is_commanded:
            raise RefusedError(f"{name} never gets torque: it is a leader, or it has no commander")
        latch = self._safety.latch()
        if latch is not None:
            raise RefusedError(f"{name}: torque stays off: {latch.text}")
        if self._energised and not actuator.relaxed:
            return f"{name}: torque is already on, so there is nothing to resume"
        try:
            actuator.check()
        except DeviceError as error:
            raise RefusedError(f"{name}: the check of the device failed: {error}") from error
        try:
            self._safety.prepare_estop()
        except DeviceError as error:
            raise RefusedError(str(error)) from error
        try:
            if self._energised:
                self._rejoin()
            else:
                self.energise()
        except SafetyTripped as error:
            self._energised = False
            self._safety.stand_down()
            raise RefusedError(f"{name}: the fault is still there: {error}") from error
        self._stopped_by = ""  # its release need not be reported any more
        self._leave_fault()
        return f"{name}: torque is on again; the joints approach the next command slowly"

    @verb(moves=True)
    def release_override(self) -> str:
        """End an override and return control to the leader or model of the file."""
        name, commanders = self.context.spec.full_name, self._commanders
        if commanders is None or not commanders.overriding:
            raise RefusedError(f"{name} has no override to release")
        if not commanders.releasable:
            raise RefusedError(
                f"{name}: the override {commanders.current} still publishes. Stop it first, or press its "
                "release button"
            )
        released = commanders.release()
        return f"{name}: the override {released} is released; the joints approach the next command slowly"

    def _rejoin(self) -> None:
        """Energises the relaxed joints; the others have torque."""
        actuator, goals = self._device()
        joints = [actuator.joint_names.index(name) for name in actuator.relaxed]
        try:
            actuator.rejoin()
            position_rad = actuator.read().position_rad
        except DeviceError as error:
            name = self.context.spec.full_name
            raise RefusedError(f"{name}: torque of the joint is still off: {error}") from error
        for joint in joints:
            goals.reseed(joint, position_rad[joint])

    def deactivate(self) -> None:
        """Brings the joints into their safe state: a leader without torque, others as planned."""
        if self._actuator is None or not self._actuator.connected:
            return
        if self._is_leader:
            self._safety.switch_off(self._actuator)
        elif self._energised:
            self._energised = False
            self._safety.apply(self._actuator)

    def cleanup(self) -> None:
        """Closes the device."""
        if self._actuator is not None:
            self._actuator.disconnect()
            self._safety.finish()

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Rates, commands, tracking error, range, and an unresolved fault."""
        results = [*self._outputs.checks(), *self._test.results(self._commands)]
        return [*results, ("torque", False, self._status.fault)] if self._status.fault else results

    def test_traces(self) -> list[JointTrace]:
        """Goal, position, effort and temperature of each joint that was commanded."""
        return self._test.traces() if self._is_commanded else []

    @property
    def _is_commanded(self) -> bool:
        return not self._is_leader and bool(self.context.spec.subscriptions)

    def _device(self) -> tuple[Actuator, GoalGenerator]:
        if self._actuator is None or self._goals is None:
            raise RuntimeError(f"{self.context.spec.full_name}: activate came before configure")
        return self._actuator, self._goals

    def _check_topics(self, actuator: Actuator) -> None:
        spec = self.context.spec
        offered = (JOINT_STATE, *actuator.further_types)
        for topic in spec.publishers:
            if topic.type_name not in offered:
                raise ConfigurationError(
                    f"{spec.full_name} cannot publish {topic.type_name} on {topic.name}: "
                    f"{type(actuator).__name__} offers {', '.join(offered)}; set data_type: JOINT_STATE"
                )
        for topic in spec.subscriptions:
            if topic.type_name not in (JOINT_STATE, JOINT_TRAJECTORY):
                raise ConfigurationError(
                    f"{spec.full_name} cannot follow {topic.type_name} on {topic.name}: an actuator follows "
                    "positions; set data_type: JOINT_STATE or JOINT_TRAJECTORY"
                )
        if self._is_leader and spec.subscriptions:
            names = ", ".join(topic.name for topic in spec.subscriptions)
            self.context.warn(f"{spec.full_name}: a leader is moved by hand, so {names} has no effect")

    def _control(self) -> None:
        """One control cycle: read, publish, write. Whatever else the device raises fails the node."""
        actuator, goals = self._device()
        self._arrivals.begin()
        try:
            reading = self._status.read(actuator, self.context.log)
        except SafetyTripped as error:
            self._trip(error)
            return
        if reading is None:
            return
        self._outputs.publish(reading.stamp_ns, lambda type_name: self._message(reading, type_name))
        if self._intervention is not None and self._commanders is not None:
            self._intervention.publish(message_class(BOOL)(data=self._commanders.overriding))
        self._test.state(reading, actuator.limits)
        if not self._energised:
            return
        if actuator.relaxed and not self._status.fault:
            self._enter_fault(f"{'; '.join(actuator.relaxed.values())}. Only this joint lost its torque")
        self._arrivals.wait()
        now_ns, stamp_ns = time.monotonic_ns(), self.context.now_ns()
        written = actuator.write(goals.step(now_ns))
        self._publish_written(written, stamp_ns)
        self._test.written(written, following=goals.state is GoalState.FOLLOWING and not goals.ramping)
        self._status.doing = goals.state.value
        self._report_state(goals.state)
        if self._on_stale is not None:
            self._obey(self._on_stale, actuator, reading)
        if self._cycle is not None:
            self._arrivals.end(self._cycle)

    def _watch(self) -> None:
        """Sends the guardian a heartbeat and obeys an e-stop."""
        actuator, _ = self._device()
        self._safety.beat()
        self._safety.keep_files()
        if self._commanders is not None:
            self._commanders.watch(time.monotonic_ns())
        latch = self._safety.latch()
        if latch is None:
            if self._stopped_by:
                self._stopped_by = ""
                if self._is_commanded:
                    self._enter_fault("the e-stop is released, but torque is still off")
                else:
                    self._leave_fault()
        elif latch.identifier != self._stopped_by:
            self._stopped_by = latch.identifier
            self._energised = False
            said = self._safety.stop_now(actuator, latch)
            self._enter_fault(f"{said}: {latch.text}")

    def _trip(self, error: SafetyTripped) -> None:
        """Handles torque off by a protection. If the device does not confirm it, the guardian acts."""
        if not error.released:
            self._safety.before_torque_off()
            raise error
        self._energised = False
        self._safety.stand_down()
        self._enter_fault(str(error))

    def _obey(self, policy: StalePolicy, actuator: Actuator, reading: JointReading) -> None:
        """Switches the torque off when commands have stopped for too long; if that fails, by the guardian."""
        reason = policy.look(reading.position_rad, time.monotonic())
        if reason:
            self._safety.before_torque_off()
            actuator.release()
            self._energised = False
            self._safety.stand_down()
            self._enter_fault(reason)

    def _enter_fault(self, reason: str, aim: str = "re-enable torque") -> None:
        spec = self.context.spec
        if self._is_commanded and self._safety.latch() is None:
            reason = f"{reason.rstrip('.')}. Run `joshua resume {spec.name}` to {aim}"
        self._status.fault = reason
        if self._commanders is not None:
            self._commanders.forget_ignored()
        self.context.fault(reason)

    def _leave_fault(self) -> None:
        self._status.fault = ""
        if self._commanders is not None:
            self._commanders.forget_ignored()
        self.context.fault("")

    def _diagnosed(self, actuator: Actuator) -> list[DiagnosticStatus]:
        """Returns the rows for ``/diagnostics``, and shows the commander in the status line."""
        if self._commanders is not None:
            self.context.show(self._commanders.shown)
        return self._status.rows(actuator, self._commanders)

    def _message(self, reading: JointReading, type_name: str) -> Any | None:
        assert self._actuator is not None
        if type_name != JOINT_STATE:
            return self._actuator.further_message(type_name, self.context.spec.frame_id)
        return joint_state(
            self._actuator.joint_names,
            reading.position_rad,
            reading.velocity_rad_s,
            reading.effort,
            frame_id=self.context.spec.frame_id,
            at_ns=reading.stamp_ns,
        )

    def _publish_written(self, written: FloatArray, stamp_ns: int) -> None:
        """Publishes with the time of the goal: later delays of the process do not distort its speed."""
        assert self._actuator is not None
        if self._written is not None:
            names, frame_id = self._actuator.joint_names, self.context.spec.frame_id
            self._written.publish(joint_state(names, written, frame_id=frame_id, at_ns=stamp_ns))

    def _report_state(self, state: GoalState) -> None:
        if state is self._last_state:
            return
        held = self._commanders is not None and self._commanders.held  # which has been logged
        if state is GoalState.HOLDING and not held:
            self.context.log.warning("commands stopped: the joints hold their position")
        elif state is GoalState.PARKING:
            self.context.log.warning("no command for too long: the joints move to their park pose")
        elif self._last_state in (GoalState.HOLDING, GoalState.PARKING):
            self.context.log.info("commands resumed: the joints approach them slowly")
        self._last_state = state
