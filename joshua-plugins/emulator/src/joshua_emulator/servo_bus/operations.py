"""Operations of the control channel for an emulated servo bus."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar

from joshua_calibration.hand import interpolate

from joshua_emulator import motion
from joshua_emulator.arms import TICKS_PER_RADIAN
from joshua_emulator.control import ControlError
from joshua_emulator.event_log import EventLog
from joshua_emulator.fault_rules import PROBABILITY, RETURNS, FaultRule, Number, Text, check_fault
from joshua_emulator.faults import FaultError, Faults
from joshua_emulator.motion import MIDDLE
from joshua_emulator.operations import Action, Request
from joshua_emulator.servo_bus.bus import EmulatedServoBus
from joshua_emulator.servo_bus.servo import EmulatedServo
from joshua_emulator.servo_bus.watched_hand import WatchedTime
from joshua_emulator.station_operations import StationOperations

#: Polling period of a fault that waits for a number of reads.
READS_LOOKED_AT_S = 0.005

_SERVO = Number("a servo id", 0, 253, whole=True)
_OF_ONE, _OF_ALL = FaultRule(_SERVO), FaultRule(_SERVO, optional=True)
_NAME = {"name": Text("a device name, such as ttyACM3", "[A-Za-z]+[0-9]+")}

FAULTS: dict[str, FaultRule] = {
    **dict.fromkeys(Faults.KINDS, PROBABILITY),
    "late": FaultRule(PROBABILITY.value, settings={"late_by_s": Number("seconds from 0 to 1", 0, 1)}),
    "silent": _OF_ALL,
    "duplicate": _OF_ONE,
    "break_after": _OF_ONE,
    "unplug": FaultRule(settings={**RETURNS.settings, **_NAME}),
    "replug": FaultRule(settings=_NAME),
    **dict.fromkeys(("brown_out", "overload", "over_temperature", "under_voltage"), _OF_ALL),
}


class Operations(StationOperations):
    """Operations by name. ``handle`` is the control channel's handler.

    Args:
        names: joint name of each servo in cable order.
        add_servo: makes a further servo with a bus id, for the fault ``duplicate``.
    """

    when: ClassVar[Mapping[str, Number]] = {
        "after_reads": Number("a number of reads from 1 on", 1, 1 << 40, whole=True)
    }
    refusals: ClassVar[tuple[type[Exception], ...]] = (FaultError, motion.MotionError, FileExistsError)

    def __init__(
        self,
        bus: EmulatedServoBus[Any],
        faults: Faults,
        log: EventLog,
        names: list[str],
        add_servo: Callable[[int], EmulatedServo],
    ) -> None:
        super().__init__(log, FAULTS)
        self._bus = bus
        self._faults = faults
        self._names = names
        self._add_servo = add_servo
        self.operations = {
            "state": self._state,
            "registers": self._registers,
            "set_register": self._set_register,
            "calibration": self._calibration,
            "log": self.read_log,
            "lateness": lambda request: self.log.lateness(clear=bool(request.get("clear"))),
            "hand": self._hand,
            "motion": self._motion,
            "guide": self._guide,
            "set": self._set,
            "fault": self.fault,
            "clear_faults": self._clear_faults,
            "quit": lambda _: self.home.stop(),
        }

    def _servos(self, request: Request) -> list[EmulatedServo]:
        """Return the servos that a request names by ``slot`` (cable order from 0) or ``id``, or all."""
        if "slot" in request:
            slot = request["slot"]
            if not 0 <= slot < len(self._bus.servos):
                raise ControlError(f"no servo at slot {slot}; there are {len(self._bus.servos)}")
            return [self._bus.servos[slot]]
        if "id" not in request:
            return list(self._bus.servos)
        found = [servo for servo in self._bus.servos if servo.servo_id == request["id"]]
        if not found:
            ids = ", ".join(str(servo.servo_id) for servo in self._bus.servos)
            raise ControlError(f"no servo has the id {request['id']}; there are {ids}")
        return found

    def _state(self, request: Request) -> dict[str, Any]:
        now_s = time.monotonic()
        line = self.home.line
        return {
            "t_ns": round(now_s * 1e9),
            "plugged": line.plugged,
            "port": str(line.port) if line.plugged else "",
            "by_id": str(line.by_id),
            "volts": self._bus.servos[0].supply.volts,
            "line_faults": self._faults.describe(),
            "fault_counts": dict(self._faults.counts),
            "reads": self.log.reads,
            "servos": [self._servo_state(servo, now_s) for servo in self._servos(request)],
        }

    def _servo_state(self, servo: EmulatedServo, now_s: float) -> dict[str, Any]:
        servo.advance(now_s)
        slot = self._bus.servos.index(servo)
        return {
            "slot": slot,
            "id": servo.servo_id,
            "joint": self._names[slot] if slot < len(self._names) else "",
            "angle": servo.joint.angle,
            "energised": servo.energised,
            "baudrate": servo.baudrate,
            **{name: servo.get(name) for name in servo.state_names},
        }

    def _registers(self, request: Request) -> dict[str, Any]:
        (servo, *_) = self._servos({"slot": 0, **request} if "id" not in request else request)
        servo.advance(time.monotonic())
        return {"registers": {name: servo.get(name) for name in servo.registers}}

    def _set_register(self, request: Request) -> None:
        name, value = request["name"], int(request["value"])
        for servo in self._servos(request):
            if name == "baudrate" and value not in servo.baudrates:
                codes = ", ".join(map(str, servo.baudrates))
                raise ControlError(f"no line speed has the code {value}; allowed: {codes}")
            servo.put(name, value)

    def _calibration(self, request: Request) -> dict[str, Any]:
        """Return the arm's calibration from its EEPROM, in the fields of a calibration block."""
        motors = [
            {
                "id": servo.servo_id,
                "joint_name": name,
                **servo.calibration(),
                "inverted": False,
            }
            for servo, name in zip(self._servos(request), self._names, strict=False)
        ]
        return {"calibration": {"device_identity": f"usb:{self.home.line.identity}", "motors": motors}}

    def _hand(self, request: Request) -> None:
        """Move joints without torque to ``ticks`` or ``radians``, in ``duration_s`` (0: at once)."""
        start_s = time.monotonic()
        duration_s = float(request.get("duration_s", 0.0))
        for servo in self._servos(request):
            servo.advance(start_s)
            if servo.energised:
                raise ControlError(f"servo {servo.servo_id} holds with its torque on; a hand cannot move it")
            ticks = float(request["ticks"]) if "ticks" in request else motion.ticks(float(request["radians"]))
            end = servo.angle_of(ticks)
            if duration_s > 0:
                points = [(start_s, servo.joint.angle), (start_s + duration_s, end)]
                servo.joint.hand = _along(points)
            else:
                servo.joint.hand = None
                servo.joint.angle = min(max(end, servo.joint.low), servo.joint.high)
            servo.advance(time.monotonic())

    def _motion(self, request: Request) -> None:
        """Start a motion of the hand: ``kind`` sine, sweep, file or none, with its settings."""
        self.start_motion(request["kind"], {k: v for k, v in request.items() if k not in ("op", "kind")})

    def start_motion(self, kind: str, values: dict[str, Any]) -> None:
        """Start a motion of the hand. Raises MotionError and ControlError."""
        if kind == "none":
            paths: dict[int, motion.Trajectory] = {}
        elif kind == "sine":
            paths = motion.sine(values, self._names)
        elif kind == "sweep":
            paths = motion.sweep(
                values, [self._range(servo) for servo in self._bus.servos[: len(self._names)]]
            )
        elif kind == "file":
            paths = motion.recorded(values, self._names)
        else:
            raise ControlError(f"unknown motion {kind!r}; allowed: none, sine, sweep, file")
        start_s = time.monotonic()
        self.log.add("motion", start_s, kind=kind)
        for slot, servo in enumerate(self._bus.servos):
            path = paths.get(slot)
            servo.joint.hand = None if path is None else _hand(servo, path, start_s)

    def _guide(self, request: Request) -> None:
        """Move the joints for a calibration: ``slot`` through its range, or all to their middles."""
        start_s = time.monotonic()
        servos = self._bus.servos[: len(self._names)]
        for servo in servos:
            servo.advance(start_s)
        if "slot" in request:
            self._servos(request)  # refuses a slot that does not exist
        zeros = [servo.angle_of(MIDDLE) for servo in servos]
        present = [
            (servo.joint.angle - zero) / TICKS_PER_RADIAN for servo, zero in zip(servos, zeros, strict=True)
        ]
        paths = motion.calibrating(
            request.get("slot"), present, [self._range(s) for s in servos], float(request["seconds"])
        )
        for slot, servo in enumerate(servos):
            servo.joint.hand = self._watched_hand(servo, paths[slot], start_s) if slot in paths else None

    def _watched_hand(
        self, servo: EmulatedServo, path: motion.Trajectory, start_s: float
    ) -> Callable[[float], float]:
        hand = _hand(servo, path, 0.0)
        time_s = WatchedTime(start_s, lambda: self.log.reads, self.home.unplugged_s)
        return lambda now_s: hand(time_s(now_s))

    def _range(self, servo: EmulatedServo) -> tuple[float, float]:
        zero = servo.angle_of(MIDDLE)
        return (servo.joint.low - zero) / TICKS_PER_RADIAN, (servo.joint.high - zero) / TICKS_PER_RADIAN

    def _set(self, request: Request) -> None:
        """Set what acts on servos, and the volts of their supply.

        ``temperature_c``, ``external_load``, ``blocked``, ``silent`` and ``object_ticks`` (something stiff
        in the joint's way; null takes it away).
        """
        for servo in self._servos(request):
            joint = servo.joint
            servo.advance(time.monotonic())
            if "volts" in request:
                servo.supply.volts = float(request["volts"])
            if "temperature_c" in request:
                joint.temperature_c = joint.ambient_c = float(request["temperature_c"])
            if "external_load" in request:
                joint.external_load = float(request["external_load"])
            if "blocked" in request:
                joint.blocked = bool(request["blocked"])
            if "object_ticks" in request:
                ticks = request["object_ticks"]
                joint.put_object(None if ticks is None else servo.angle_of(float(ticks)))
            if "silent" in request:  # its cable is off
                servo.silent = bool(request["silent"])

    def fault(self, request: Request) -> None:
        """Inject a fault, now, ``at_s`` later, or with the ``after_reads``-th read of the bus."""
        check_fault(request, FAULTS, self.when)
        if (after_reads := int(request.get("after_reads", 0))) > 0:
            self._after_reads(after_reads, self.fault_action(request["kind"], request))
        else:
            super().fault(request)

    def _after_reads(self, count: int, action: Action) -> None:
        if self.log.reads >= count:
            action()
        else:
            self.later(READS_LOOKED_AT_S, lambda: self._after_reads(count, action))

    def fault_action(self, kind: str, request: Request) -> Action:
        """Return the action that injects a fault. Raises ControlError if it is refused."""
        if kind in Faults.KINDS:
            values = {kind: request["value"]}
            if "late_by_s" in request:
                values["late_by_s"] = request["late_by_s"]
            return lambda: self._faults.set(values)
        servo_id = {"id": request["value"]} if "value" in request else {}
        actions: dict[str, Action] = {
            "silent": lambda: self._each(self._servos(servo_id), _silence),
            "duplicate": lambda: self._duplicate(request["value"]),
            "break_after": lambda: self._break_after(request["value"]),
            "unplug": lambda: self._unplug(request),
            "replug": lambda: self._replug(request.get("name") or self.home.line.name),
            "brown_out": lambda: self._each(self._servos(servo_id), self._brown_out),
            "overload": lambda: self._each(self._servos(servo_id), _overload),
            "over_temperature": lambda: self._set({**servo_id, "temperature_c": 85}),
            "under_voltage": lambda: self._each(self._servos(servo_id), _starve),
        }
        if servo_id:
            self._servos(servo_id)  # reject an unknown id now, not when the fault is due
        return actions[kind]

    def _clear_faults(self, _: Request) -> None:
        self._faults.clear()
        self._bus.connected = len(self._bus.servos)
        for servo in self._bus.servos:
            servo.silent = False

    def _each(self, servos: Iterable[EmulatedServo], action: Callable[[EmulatedServo], None]) -> None:
        for servo in servos:
            action(servo)

    def _duplicate(self, servo_id: int) -> None:
        self._servos({"id": servo_id})
        self._bus.attach(self._add_servo(servo_id))

    def _break_after(self, servo_id: int) -> None:
        (servo, *_) = self._servos({"id": servo_id})
        self._bus.connected = self._bus.servos.index(servo) + 1
        for lost in self._bus.servos[self._bus.connected :]:
            lost.power_on(time.monotonic())

    def _unplug(self, request: Request) -> None:
        name = request.get("name") or self.home.line.name
        self.home.unplug()
        if "replug_after_s" in request:
            self.later(float(request["replug_after_s"]), lambda: self._replug(name))

    def _replug(self, name: str) -> None:
        line = self.home.line
        if not (line.plugged and line.name == name):
            self.home.replug(name)

    def _brown_out(self, servo: EmulatedServo) -> None:
        now_s = time.monotonic()
        servo.advance(now_s)
        servo.power_on(now_s)
        self.log.add("brown_out", now_s, id=servo.servo_id)


def _silence(servo: EmulatedServo) -> None:
    servo.silent = True


def _starve(servo: EmulatedServo) -> None:
    servo.supply.volts = servo.low_volts


def _overload(servo: EmulatedServo) -> None:
    servo.overload(time.monotonic())


def _hand(servo: EmulatedServo, path: motion.Trajectory, start_s: float) -> Callable[[float], float]:
    zero = servo.angle_of(MIDDLE)
    return lambda now_s: zero + path(max(0.0, now_s - start_s)) * TICKS_PER_RADIAN


def _along(points: list[tuple[float, float]]) -> Callable[[float], float]:
    return lambda now_s: interpolate(points, now_s)
