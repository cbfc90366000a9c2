"""Brings an arm into its safe state without its driver, for the guardian.

Needs only the port, not the driver's state. Light to import: no numpy, no pydantic.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from joshua.api import DeviceBusy, DeviceError, SafeStopRequest, SafeStopResult, TorqueState
from joshua.api.patience import AwakeClock
from joshua_serial.errors import PortDisconnected
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint

from joshua_servo.bus import ServoBus
from joshua_servo.errors import NoReply
from joshua_servo.family import ServoFamily
from joshua_servo.register_read import read_registers
from joshua_servo.tuning import StoredRegister, restore

if TYPE_CHECKING:
    from typing_extensions import Self

RETRY_S = 0.01  # between attempts to open a port that its ending owner still uses
ROUND_S = 0.06  # for the replies to one round of requests, before they are sent again
RELEASE_RESERVE_S = 0.15  # of the time for parking, reserved for releasing and verifying
PADDING = bytes(64)  # longer than any packet of a driver
ARRIVED_TICKS = 30  # about 2.6°
PARK_SPEED_TICKS_S = 500  # about 0.8 rad/s


@dataclass(frozen=True)
class ServoStopRequest(SafeStopRequest):
    """The safe stop of servos. A driver derives a class that names the family and the bus.

    Attributes:
        path, serial_number, vid_pid, device_root, baudrate: the port.
        park_ticks: pose of PARK_THEN_RELEASE by servo id; park_speed_ticks_s: how fast.
        eeprom: original values of the EEPROM registers that the driver changed, by servo id.
        grips: joints that may hold an object, by servo id: the squeeze beyond the position in ticks, and the
            value of the torque limit. HOLD keeps the goal that far beyond the position.
        torque_limit: address and width of the register of that limit.
        echo: whether the adapter echoes sent bytes; None if unknown. Detecting it takes 20 ms.
    """

    family: ClassVar[ServoFamily]
    make_bus: ClassVar[type[ServoBus]]

    ids: tuple[int, ...] = ()
    baudrate: int = 1_000_000
    path: str = ""
    serial_number: str = ""
    vid_pid: str = ""
    device_root: str = "/"
    park_ticks: Mapping[int, int] = field(default_factory=dict)
    park_speed_ticks_s: int = PARK_SPEED_TICKS_S
    eeprom: Mapping[int, Sequence[StoredRegister]] = field(default_factory=dict)
    grips: Mapping[int, tuple[int, int]] = field(default_factory=dict)
    torque_limit: tuple[int, int] = (0, 0)
    echo: bool | None = None

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> Self:
        """Read the result of ``to_values``: JSON has lists instead of tuples, and strings as keys."""
        park = {int(key): ticks for key, ticks in values.get("park_ticks", {}).items()}
        eeprom = {int(key): [tuple(row) for row in rows] for key, rows in values.get("eeprom", {}).items()}
        grips = {int(key): tuple(grip) for key, grip in values.get("grips", {}).items()}
        typed = {"ids": tuple(values["ids"]), "park_ticks": park, "eeprom": eeprom, "grips": grips}
        return cls(**{**values, **typed, "torque_limit": tuple(values.get("torque_limit", (0, 0)))})

    def run(self) -> SafeStopResult:
        """Open the port, apply the safe state and verify it. Never raises errors of the device."""
        return run(self, self.family, self.make_bus).result()

    def read_torque(self) -> dict[str, bool]:
        """Read which servos have torque, by id. Raises DeviceError, also if one does not reply."""
        return _SafeStop(self, self.family, self.make_bus).read_torque()


@dataclass
class SafeStopReport:
    """The result, as read back from the servos.

    Attributes:
        joints: ``held``, ``released``, ``was off`` or ``not verified`` by servo id.
        duration_s: from the call to the verification.
        detail: what prevented the safe state, "" for nothing.
    """

    action: str
    joints: dict[int, TorqueState]
    duration_s: float = 0.0
    detail: str = ""

    @property
    def complete(self) -> bool:
        """Whether every servo has confirmed its safe state."""
        return all(state != "not verified" for state in self.joints.values())

    def result(self) -> SafeStopResult:
        """The report in the common form."""
        joints = {str(servo_id): state for servo_id, state in self.joints.items()}
        return SafeStopResult(joints, self.action, self.detail, self.duration_s)


def run(request: ServoStopRequest, family: ServoFamily, make_bus: type[ServoBus]) -> SafeStopReport:
    """Open the port, apply the safe state and verify it. Never raises errors of the device.

    Bounded by ``timeout_s`` of awake time plus the time of one request to every servo.
    """
    start_s = time.monotonic()
    stop = _SafeStop(request, family, make_bus)
    try:
        stop.run()
    except DeviceError as error:
        stop.report.detail = str(error)
    finally:
        stop.close()
    stop.report.duration_s = time.monotonic() - start_s
    if not stop.report.complete and not stop.report.detail:
        silent = ", ".join(str(i) for i, state in stop.report.joints.items() if state == "not verified")
        stop.report.detail = f"ids {silent} did not confirm. Cut the arm's supply by hand if it still holds"
    return stop.report


class _SafeStop:
    def __init__(self, request: ServoStopRequest, family: ServoFamily, make_bus: type[ServoBus]) -> None:
        self.request = request
        self._family = family
        self.report = SafeStopReport(request.action, dict.fromkeys(request.ids, "not verified"))
        self._clock = AwakeClock()
        self._deadline_s = self._clock.now_s() + request.timeout_s
        endpoint = Endpoint(request.path, request.serial_number, request.vid_pid, request.device_root)
        self._port = SerialPort(endpoint, request.baudrate)
        self._bus = make_bus(self._port)
        self._echo = request.echo

    def run(self) -> None:
        """Act, and restart if the adapter is disconnected and returns in time."""
        while True:
            try:
                self._act()
            except PortDisconnected:
                if not self._time_left():
                    raise
                self._echo = None  # the adapter that returns can be another one
                time.sleep(RETRY_S)
            else:
                return

    def _act(self) -> None:
        self._open()
        # A killed driver may have left an incomplete packet, and servos would treat this one as its rest.
        self._port.send(PADDING)
        if self.request.action == "RELEASE":
            self._send_release()  # first of all; an echo of the adapter matters only for reading
        if self._echo is None:
            self._bus.detect_echo()
        else:
            self._bus.echoes = self._echo
        if self.request.action == "HOLD":
            self._hold()
        if self.request.action == "PARK_THEN_RELEASE":
            self._park()
        if self.request.action != "HOLD":
            self._release()
        if self.report.complete and self._time_left():
            restore(self._bus, self.request.eeprom)

    def close(self) -> None:
        self._port.close()

    def read_torque(self) -> dict[str, bool]:
        """Read which servos have torque, by id, as soon as an ending owner has closed the port."""
        torque, ids = self._family.torque_enable, self.request.ids
        try:
            self._open_once_free()
            self._port.send(PADDING)
            self._bus.detect_echo()
            left_s = max(ROUND_S, self._deadline_s - self._clock.now_s())
            found = self._bus.sync_read(torque.address, torque.width, ids, within_s=left_s)
        finally:
            self.close()
        if silent := [str(servo_id) for servo_id in ids if servo_id not in found]:
            raise NoReply(f"{self._port}: ids {', '.join(silent)} do not report their torque")
        return {str(servo_id): torque.decode(found[servo_id]) != 0 for servo_id in ids}

    def _open_once_free(self) -> None:
        while True:
            try:
                self._port.open()
            except DeviceBusy:
                if not self._time_left():
                    raise
                time.sleep(RETRY_S)
            else:
                return

    def _open(self) -> None:
        """Open the port as soon as its last owner has ended, or the adapter is back and accessible."""
        while True:
            try:
                self._port.open()
            except DeviceError:
                if not self._time_left():
                    raise
                time.sleep(RETRY_S)
            else:
                return

    def _time_left(self) -> bool:
        return self._clock.now_s() < self._deadline_s

    def _states(self, ids: tuple[int, ...]) -> dict[int, tuple[bool, int, int]]:
        """Torque, goal and present position in ticks of the servos that reply."""
        family = self._family
        torque, goal, present = family.torque_enable, family.goal_position, family.present_position
        found = read_registers(self._bus, family, (torque, goal, present), ids, within_s=ROUND_S)
        return {
            servo_id: (
                torque.decode(values[torque]) != 0,
                goal.decode(values[goal]),
                present.decode(values[present]),
            )
            for servo_id, values in found.items()
        }

    def _hold(self) -> None:
        seeded: dict[int, int] = {}
        waiting = self.request.ids
        while waiting:
            for servo_id, (torque, goal, present) in self._states(waiting).items():
                if not torque:
                    self.report.joints[servo_id] = "was off"  # a goal would switch it on
                elif seeded.get(servo_id) == goal:
                    self.report.joints[servo_id] = "held"
                else:
                    squeeze, _ = self.request.grips.get(servo_id, (0, 0))
                    ahead = max(-squeeze, min(squeeze, goal - present))
                    seeded.setdefault(servo_id, present + ahead)
            waiting = tuple(i for i in waiting if self.report.joints[i] == "not verified")
            self._limit_grips([i for i in waiting if i in seeded])
            self._send_goals({i: seeded[i] for i in waiting if i in seeded})
            if not self._time_left():
                return

    def _park(self) -> None:
        """Move energised joints to the park pose, leaving enough time to release them within the deadline."""
        deadline_s = self._deadline_s - RELEASE_RESERVE_S
        going = {i: ticks for i, ticks in self.request.park_ticks.items() if i in self.report.joints}
        register = self._family.speed
        speed = register.encode(self._family.speed_of(self.request.park_speed_ticks_s))
        while going and self._clock.now_s() < deadline_s:
            states = self._states(tuple(going))
            for servo_id, (torque, _, present) in states.items():
                if not torque or abs(present - going[servo_id]) <= ARRIVED_TICKS:
                    del going[servo_id]
            stray = {i: ticks for i, ticks in going.items() if i in states and states[i][1] != ticks}
            if stray:
                self._bus.sync_write(register.address, register.width, dict.fromkeys(stray, speed))
                self._send_goals(stray)
        if going:
            ids = ", ".join(str(servo_id) for servo_id in going)
            self.report.detail = f"released before ids {ids} reached the park pose"

    def _send_goals(self, goals_ticks: Mapping[int, int]) -> None:
        goal = self._family.goal_position
        if goals_ticks:
            rows = {i: goal.encode(ticks) for i, ticks in goals_ticks.items()}
            self._bus.sync_write(goal.address, goal.width, rows)

    def _limit_grips(self, ids: Sequence[int]) -> None:
        """Lower the torque of joints that may hold an object, because pressing on it would trip them."""
        address, width = self.request.torque_limit
        grips = self.request.grips
        if rows := {i: grips[i][1].to_bytes(width, "little") for i in ids if i in grips}:
            self._bus.sync_write(address, width, rows)

    def _send_release(self) -> None:
        torque = self._family.torque_enable
        self._bus.sync_write(torque.address, torque.width, dict.fromkeys(self.request.ids, torque.encode(0)))

    def _release(self) -> None:
        waiting = self.request.ids
        torque = self._family.torque_enable
        while True:
            self._send_release()
            found = self._bus.sync_read(torque.address, torque.width, waiting, within_s=ROUND_S)
            for servo_id, state in found.items():
                if torque.decode(state) == 0:
                    self.report.joints[servo_id] = "released"
            waiting = tuple(i for i in waiting if self.report.joints[i] == "not verified")
            if not waiting or not self._time_left():
                return
