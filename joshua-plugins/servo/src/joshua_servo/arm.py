"""The actuator of a servo bus: an arm of servos, in radians.

Why one file: one class, the life of an arm from its connection to its safe stop.
"""

from __future__ import annotations

import threading
import time
from abc import abstractmethod
from collections.abc import Collection, Mapping, Sequence
from typing import ClassVar

import numpy as np
from joshua.api import (
    Actuator,
    ActuatorContext,
    DeviceDisconnected,
    DeviceError,
    DiagnosticStatus,
    FloatArray,
    JointLimits,
    JointReading,
)
from joshua_serial.errors import PortDisconnected
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint

from joshua_servo.bus import ServoBus
from joshua_servo.diagnostics import bus_row, joint_rows
from joshua_servo.errors import CalibrationMismatch, NoReply, NotCalibrated, NotEnabled, SafetyTripped
from joshua_servo.family import ServoFamily
from joshua_servo.feedback import Feedback
from joshua_servo.grip import Grips
from joshua_servo.handover import open_unguarded
from joshua_servo.inspection import ServoSetup, has_values
from joshua_servo.joint_map import JointMap
from joshua_servo.safe_stop import ServoStopRequest
from joshua_servo.settings import ServoSettings
from joshua_servo.state import StateReader
from joshua_servo.torque import MoveValues, TorqueSwitch
from joshua_servo.tuning import Tuning
from joshua_servo.watch import MOST_SAMPLES, SAMPLE_PAUSE_S, HealthLimits, HealthWatch

HOLD_S = 0.06  # a servo without a reply delays the hold of the others by at most two requests
TORQUE_CHECK_S = 0.5  # interval of the torque checks while all replies arrive
MAX_RATE_WINDOW_S = 0.5  # after a pause, the distance to a goal is at most this many seconds at full speed


class ServoArm(Actuator):
    """An arm on one bus; a driver adds the bus of its protocol and the registers of its servos.

    Args:
        settings: the arm.
        context: of its node. ``allow_uncalibrated`` allows torque without a calibration, in radians relative
            to the middle of the range. ``remembered`` identifies the adapter.
    """

    settings: ServoSettings
    #: Family of the servos.
    family: ClassVar[ServoFamily]
    #: The safe-stop request that works without this driver.
    stop_request: ClassVar[type[ServoStopRequest]]

    def __init__(self, settings: ServoSettings, context: ActuatorContext | None = None) -> None:
        super().__init__(settings, context)
        self._ids = settings.motor_ids
        self._map = JointMap(settings)
        self._watch = HealthWatch(settings.joint_names, [HealthLimits()] * len(self._ids), self.family.status)
        adapter = self.context.remembered  # found by the previous driver
        self._port = SerialPort(
            Endpoint(
                settings.port,
                settings.serial_number or adapter.get("serial_number", ""),
                settings.vid_pid or adapter.get("vid_pid", ""),
                settings.device_root,
                settings.calibration.device_identity if settings.calibration else "",
            ),
            settings.baudrate,
        )
        self._bus = self.make_bus(self._port)
        names = dict(zip(self._ids, settings.joint_names, strict=True))
        self._torque = TorqueSwitch(self._bus, self.family, names)
        self._state = StateReader(self._bus, self.family, names, self.parse)
        self._tuning = Tuning(self._bus, self.family, settings.register_values())
        self._grips = Grips(settings, self._bus)
        self._lock = threading.RLock()
        self._enabled = False
        self._tripped = ""
        self._relaxed: dict[int, str] = {}  # index of the joint, and why it has no torque
        self._under_voltage: set[int] = set()
        self._relax_alone = [
            index
            for index, joint in enumerate(settings.joint_settings)
            if joint.gripper or settings.are_grippers_unknown
        ]
        # rad, not rounded, because slow motions are less than a tick per cycle
        self._goal: list[float] = [0.0] * len(self._ids)
        self._goal_ticks, self._written_s = [0] * len(self._ids), 0.0
        self._readings: list[Feedback] = []
        self._setups: list[ServoSetup] = []
        self._lost_reported = self._lost_checked = 0
        self._torque_checked_s = 0.0

    @abstractmethod
    def make_bus(self, port: SerialPort) -> ServoBus:
        """Make the bus of the servos' protocol."""

    @abstractmethod
    def inspect(self) -> list[ServoSetup]:
        """Check the servos on the open bus and read their EEPROM, in joint order.

        Raises:
            DeviceError: they are not those of the configuration, or of the calibration.
        """

    @abstractmethod
    def move_values(self) -> list[MoveValues]:
        """Register values of a move without the goal, in joint order."""

    def parse(self, values: Sequence[bytes]) -> list[Feedback]:
        """Read the blocks of feedback of all servos, in joint order."""
        parse_feedback = self.family.parse_feedback
        return [parse_feedback(value) for value in values]

    @property
    def latched_faults(self) -> int:
        """Status bits that a servo keeps until they are cleared."""
        return self.family.status.at_once

    @abstractmethod
    def clear_faults(self, ids: Sequence[int]) -> None:
        """Clear latched faults of servos without torque. Raises DeviceError."""

    def check_start(self, positions: Sequence[int], only: Collection[int] | None = None) -> None:
        """Refuse positions in ticks from which a servo cannot start. Raises DeviceError.

        Args:
            only: indices of the joints that start; None for all.
        """

    @property
    def limits(self) -> JointLimits:
        """The tightest of configuration, calibration and, once connected, the servos' EEPROM."""
        return self._map.limits()

    @property
    def connected(self) -> bool:
        """Whether the port is open."""
        return self._port.is_open

    @property
    def enabled(self) -> bool:
        """Whether this driver has energised the joints and, as far as it knows, they still have torque."""
        return self._enabled

    @property
    def identity(self) -> str:
        """Identity of the adapter, such as ``usb:5A46082345``; "" if it has none or is not known yet."""
        return self._port.entry.identity

    @property
    def bus(self) -> ServoBus:
        """The bus, for set-up and calibration."""
        return self._bus

    def connect(self) -> None:
        """Open the port, check the motors and read their limits, without writing.

        After a disconnection, the adapter is found by its identity under any name.

        Raises:
            DeviceError: the device is already open, or one of its kinds with cause and remedy.
        """
        if self.connected:
            raise DeviceError(f"{type(self).__name__}.connect: the device is already open")
        with self._lock:
            open_unguarded(self._port, self.context.stopping)
            try:
                self.check()
            except BaseException:
                self._port.close()
                raise
            self._enabled = False
            self._tripped = ""
            self._follow_identity()
            self._warn_of_unknown_grippers()

    def check(self) -> None:
        """Check the motors as at the start and read their limits, without writing. Raises DeviceError."""
        self.require_connected("check")
        with self._lock:
            try:
                setups = self.inspect()
            except CalibrationMismatch as error:
                raise self._explained(error) from None
            positions = self._state.positions()
            self._map = JointMap(self.settings)
            self._setups = setups
            self._map.tighten(
                [setup.min_position for setup in setups],
                [setup.max_position for setup in setups],
                [setup.max_speed for setup in setups],
            )
            self._map.follow_turns(positions, [setup.turns for setup in setups])
            self._watch = HealthWatch(
                self.joint_names, [setup.health for setup in setups], self.family.status
            )

    def _explained(self, error: CalibrationMismatch) -> CalibrationMismatch:
        """The error, naming the arm whose values the servos hold, if its calibration is in reach."""
        from joshua_calibration.other_arms import fitting_entry  # loads the configuration again

        facts = self.context.facts
        fit = fitting_entry(
            facts.source,
            facts.overrides,
            facts.node_name,
            lambda other: has_values(other, error.setups),
        )
        return error if fit is None else error.explained(fit.cause, fit.remedy)

    def read(self) -> JointReading:
        """Read the state of all joints; effort is the fraction of stall torque.

        Raises:
            DeviceDisconnected: the port is gone.
            NoReply: a servo does not answer.
            SafetyTripped: a protection has just disabled the torque. Reading continues afterwards.
        """
        self.require_connected("read")
        with self._lock:
            readings, stamp_ns = self._state.feedback()
            self._readings = readings
            self._report_voltage(readings)
            if self._enabled:
                self._trip_where_needed(readings)
                self._grips.look(readings, self._goal_ticks, time.monotonic())
        return JointReading(stamp_ns, *self._map.motion(readings))

    def prepare(self) -> None:
        """Clear latched faults, write the settings of single servos, and determine the counted turns.

        Raises NotCalibrated, unless the plan waives the calibration, and DeviceDisconnected.
        """
        self.require_connected("prepare")
        self._require_calibration()
        with self._lock:
            self._prepare(self._ids)

    def _prepare(self, ids: Sequence[int]) -> None:
        """Clear latched faults of servos without torque, write their settings, and find their turns."""
        readings = self._state.settled_feedback()
        if not self._dry_run:
            latched = [
                servo_id
                for servo_id, reading in zip(self._ids, readings, strict=True)
                if servo_id in ids and reading.status & self.latched_faults
            ]
            if latched:
                self.clear_faults(latched)
                readings = self._state.settled_feedback()
            self._tuning.apply()
            self._grips.reset()
        positions = [reading.position for reading in readings]
        self._map.follow_turns(positions, [setup.turns for setup in self._setups])

    def enable(self) -> None:
        """Prepare the joints and energise them where they are, verified by reading back.

        Raises:
            SafetyTripped: a protection would trip immediately.
            DeviceError: as ``prepare``, or a servo did not accept it. Then all joints are released.
        """
        self.require_connected("enable")
        with self._lock:
            self.prepare()
            readings = self._healthy_feedback()
            present = [reading.position for reading in readings]
            self.check_start(present)
            if not self._dry_run:
                self._torque.switch_on(present, self.move_values())
            self._enabled = True
            self._tripped = ""
            self._relaxed = {}
            self._remember(self._map.radians(present).tolist(), present)

    def _healthy_feedback(self) -> list[Feedback]:
        """Feedback before torque, judged by each protection from as many samples as it needs.

        Raises SafetyTripped if a protection would trip while the arm runs.
        """
        self._watch.reset()
        reason = ""
        for _ in range(MOST_SAMPLES):
            readings = self._state.settled_feedback()
            reason = self._watch.trip_reason(readings)
            if reason:
                break
            if not self._watch.undecided:
                return readings
            time.sleep(SAMPLE_PAUSE_S)
        reason = reason or "the supply voltage leaves its allowed range again and again"
        raise SafetyTripped(f"{self._port}: torque stays off: {reason}. Remove the cause, then try again.")

    @property
    def relaxed(self) -> Mapping[str, str]:
        """Joints whose torque alone is off after an overload, and why; the others have torque.

        These are grippers. Without a calibration and without ``gripper`` in a joint block it is any joint,
        because an object that is gripped must not drop the whole arm.
        """
        return {self.joint_names[index]: reason for index, reason in self._relaxed.items()}

    def rejoin(self) -> None:
        """Energise the relaxed joints where they are; the others keep their torque.

        Raises:
            SafetyTripped: a protection would trip immediately.
            DeviceError: as ``enable``.
        """
        self.require_connected("rejoin")
        with self._lock:
            ids = [self._ids[index] for index in self._relaxed]
            self._prepare(ids)
            readings = self._healthy_feedback()
            present = [reading.position for reading in readings]
            self.check_start(present, tuple(self._relaxed))
            self._torque.switch_on(present, self.move_values(), ids)
            for index in self._relaxed:
                self._goal_ticks[index] = present[index]
                self._goal[index] = float(self._map.radians(present)[index])
            self._relaxed = {}

    def write(self, goal_rad: FloatArray) -> FloatArray:
        """Commands positions, shape (N,). Returns what was written after clamp, rate limit and rounding.

        Raises:
            ValueError: a wrong shape or a value that is not finite.
            SafetyTripped, NotEnabled: torque is off; a written goal would switch it on in the servo.
            DeviceDisconnected: the port is gone.
        """
        self.require_connected("write")
        wanted = self.checked_goal(goal_rad).tolist()
        with self._lock:
            if self._tripped:
                raise SafetyTripped(
                    f"{self._port}: torque was disabled: {self._tripped}. Enable it again first."
                )
            if not self._enabled:
                raise NotEnabled(f"{self._port}: torque is off: call enable first")
            elapsed_s = min(time.monotonic() - self._written_s, MAX_RATE_WINDOW_S)
            goal = self._map.limited(wanted, self._goal, elapsed_s)
            ticks = self._map.ticks(goal, self._goal_ticks)
            if not self._dry_run:
                self._grips.write_limits(time.monotonic())
            written = self._grips.goals(ticks)
            self._send_goals(written)
            self._remember(goal, ticks)
            return self._map.radians(written)

    def hold(self) -> None:
        """Stop the joints at their positions and keep a grip. No effect without torque.

        Raises DeviceDisconnected, also if a servo does not reply. The others then hold already.
        """
        self.require_connected("hold")
        with self._lock:
            if not self._enabled:
                return
            found = self._state.found_positions(HOLD_S)
            last = self._goal_ticks
            present = [found.get(servo_id, last[index]) for index, servo_id in enumerate(self._ids)]
            held = self._grips.held(present, last)
            self._send_goals(held, found)
            self._remember(self._map.radians(held).tolist(), held)
            self._state.require_all(found)

    def release(self) -> None:
        """Disable the torque of all joints and verify it. No effect on a closed device.

        Raises:
            DeviceDisconnected: a servo does not confirm it.
        """
        with self._lock:
            self._enabled = False
            if self.connected:
                self._torque.switch_off()

    def read_torque(self) -> dict[str, bool]:
        """Read back which joints have torque. Raises DeviceDisconnected."""
        self.require_connected("read_torque")
        with self._lock:
            return self._torque.read()

    def disconnect(self) -> None:
        """Restore the servos' EEPROM and close the port without changing the torque. Idempotent."""
        with self._lock:
            self._enabled = False
            if self.connected and self._tuning.before:
                self._restore()
            self._port.close()

    def _restore(self) -> None:
        """Restore the EEPROM, unless a servo does not reply, because the guardian must not be delayed."""
        try:
            if self._state.missed:
                raise NoReply("a servo does not reply")
            self._tuning.restore()
        except PortDisconnected:
            return  # reported, and the guardian restores what it can
        except DeviceError as error:
            ids = ", ".join(map(str, self._tuning.before))
            self.context.log.warning("ids %s keep the settings of this run in their EEPROM: %s", ids, error)

    def diagnostics(self) -> list[DiagnosticStatus]:
        """One row for each joint as last read, and one for the bus."""
        with self._lock:
            hardware_id = self.identity or self._port.entry.path
            row = bus_row(self._bus.counters, self._lost_reported, hardware_id)
            self._lost_reported = self._lost
            if not self._readings:
                return [row]
            motion = self._map.motion(self._readings)[:2]
            names, ids = self.joint_names, self._ids
            return [*joint_rows(names, ids, self._readings, motion, self._watch, hardware_id), row]

    def safe_stop_request(
        self, action: str, *, park_pose_rad: Sequence[float] = (), timeout_s: float = 2.0
    ) -> ServoStopRequest:
        """Return the guardian's request for the safe state of this arm without this driver.

        Args:
            action: ``HOLD``, ``RELEASE`` or ``PARK_THEN_RELEASE``.
            park_pose_rad: pose of PARK_THEN_RELEASE, one angle for each joint.
            timeout_s: time limit.
        """
        park: Mapping[int, int] = {}
        if len(park_pose_rad):
            ticks = self._map.ticks(self.checked_goal(np.array(park_pose_rad)))
            park = dict(zip(self._ids, ticks, strict=True))
        endpoint = self._port.endpoint
        return self.stop_request(
            action=action,
            ids=self._ids,
            baudrate=self.settings.baudrate,
            path=self._port.entry.path,
            serial_number=endpoint.serial_number,
            vid_pid=endpoint.vid_pid,
            device_root=endpoint.device_root,
            park_ticks=park,
            eeprom=self._tuning.before,
            grips=self._grips.stops,
            torque_limit=self._grips.limit_register,
            echo=self._bus.echoes if self.connected else None,
            timeout_s=timeout_s,
        )

    @property
    def _dry_run(self) -> bool:
        return self.context.facts.dry_run

    def _follow_identity(self) -> None:
        """Follow this adapter under any name from now on."""
        entry, endpoint = self._port.entry, self._port.endpoint
        if entry.serial_number:
            self._port.endpoint = Endpoint(
                endpoint.path, entry.serial_number, entry.vid_pid, endpoint.device_root
            )

    def _require_calibration(self) -> None:
        if self.settings.calibration is None and not self.context.facts.allow_uncalibrated:
            raise NotCalibrated(
                f"{self._port}: the arm is not calibrated, so its joints are not energised. Run a "
                "MODE_CALIBRATION configuration such as the preset calibrate_so_arm100, or pass "
                "--allow-uncalibrated to drive it about the middle of position_min and position_max."
            )

    def _warn_of_unknown_grippers(self) -> None:
        """Say what an overload does to an arm that gets torque without a calibration."""
        facts = self.context.facts
        is_commanded = bool(facts.commanders or facts.external)
        if not (facts.allow_uncalibrated and is_commanded and self.settings.are_grippers_unknown):
            return
        self.context.log.warning(
            "%s: the arm is not calibrated, so it is unknown which joint is the gripper. A joint that stalls "
            "loses its torque alone, and the others keep theirs. Name the gripper in the file, for example "
            "joint { motor_id: %d gripper: true }, or calibrate the arm",
            self._port,
            self._ids[-1],
        )

    def _trip_where_needed(self, readings: Sequence[Feedback]) -> None:
        overloaded = [
            index
            for index in self._relax_alone
            if index not in self._relaxed and self._watch.is_overload_alone(readings[index])
        ]
        reason = self._watch.trip_reason(readings, {*self._relaxed, *overloaded})
        if not reason:
            self._relax({index: self._watch.reported(index, readings[index]) for index in overloaded})
            reason = self._lapse()
        if not reason:
            return
        self._tripped = reason
        self._enabled = False
        self.context.before_torque_off()
        try:
            self._torque.switch_off()
        except DeviceDisconnected as error:
            text = f"{self._port}: {reason}; torque could not be verified as off: {error}"
            raise SafetyTripped(text, released=False) from error
        raise SafetyTripped(
            f"{self._port}: {reason}. The torque of this arm is off. Find the cause (a blocked joint, heat, "
            "the supply)."
        )

    def _report_voltage(self, readings: Sequence[Feedback]) -> None:
        """Log once for each period in which a servo reports its supply voltage as out of range."""
        reporting = {i for i, reading in enumerate(readings) if reading.status & self.family.status.voltage}
        for index in sorted(reporting - self._under_voltage):
            self.context.log.warning(
                "%s reports its supply voltage as out of range: %.1f V. Check the supply and its cable",
                self.joint_names[index],
                readings[index].voltage_v,
            )
        self._under_voltage = reporting

    def _relax(self, reasons: Mapping[int, str]) -> None:
        """Disable the torque of single joints. A goal would enable it: none is written until ``rejoin``."""
        if not reasons:
            return
        self._relaxed.update(reasons)
        try:
            self._torque.switch_off([self._ids[index] for index in reasons])
        except DeviceDisconnected as error:
            self._enabled = False
            self.context.before_torque_off()
            text = "; ".join(reasons.values())
            raise SafetyTripped(
                f"{self._port}: {text}. Its torque may still be on: {error}", released=False
            ) from error

    def _lapse(self) -> str:
        """Check the torque periodically and after each lost reply, because a power cut resets servos."""
        lost, now_s = self._lost, time.monotonic()
        if self._dry_run or (lost == self._lost_checked and now_s - self._torque_checked_s < TORQUE_CHECK_S):
            return ""
        self._lost_checked, self._torque_checked_s = lost, now_s
        lapsed = self._torque.lapsed()
        text = "lost torque or settings without a command: the supply was interrupted"
        return f"{lapsed} {text}" if lapsed else ""

    @property
    def _lost(self) -> int:
        return sum(self._bus.counters.lost.values())

    def _send_goals(self, ticks: Sequence[int], only: Collection[int] | None = None) -> None:
        """Write goals in joint order, except to relaxed joints and ids that are not in ``only``."""
        if self._dry_run:
            return
        goal = self.family.goal_position
        rows = {
            servo_id: goal.encode(tick)
            for index, (servo_id, tick) in enumerate(zip(self._ids, ticks, strict=True))
            if index not in self._relaxed and (only is None or servo_id in only)
        }
        if not rows:
            return
        self._bus.sync_write(goal.address, goal.width, rows)

    def _remember(self, goal_rad: list[float], ticks: Sequence[int]) -> None:
        self._goal, self._goal_ticks = goal_rad, list(ticks)
        self._written_s = time.monotonic()
