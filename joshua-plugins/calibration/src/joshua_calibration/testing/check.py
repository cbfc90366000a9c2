"""The conformance check of calibration targets."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection

from joshua.api import DeviceError
from joshua.api.calibration import ArmCalibration, MotorCalibration
from joshua.testing import lifecycle
from joshua.testing.conformance import Checklist, name_of, refuses, require

from joshua_calibration.sweep import MOVED, SMALLEST_RANGE
from joshua_calibration.target import CalibrationTarget, Hand, StoredMotor, TargetMotor
from joshua_calibration.testing.values import (
    LARGEST_ID,
    check_kept,
    check_motor,
    check_positions,
    check_still,
    kept_in_the_end,
    sample_value,
)
from joshua_calibration.track import Track

TargetFactory = Callable[[], CalibrationTarget]

#: Duration of a motion of the hand, and period of the readings meanwhile.
HAND_S, LOOK_EVERY_S = 0.8, 0.02

#: A longer reading may have missed a part of the motion, which is then repeated, at most ``MOTIONS`` times.
LONGEST_LOOK_S, MOTIONS = 0.15, 4

#: A joint within ``REST_TICKS`` for ``REST_LOOKS`` readings rests; a stalled hand takes this much longer.
REST_LOOKS, REST_TICKS, OVERTIME_S = 8, 2, 10.0


def check_calibration_target(
    factory: TargetFactory,
    *,
    hand: Hand | None = None,
    unplug: Callable[[CalibrationTarget], None] | None = None,
    timeout_s: float = 10.0,
    only: Collection[str] = (),
) -> None:
    """Check a driver against the contract of ``joshua_calibration.target.CalibrationTarget``.

    The check overwrites the stored values and restores them. Torque stays off, so support an arm that sinks.

    Args:
        factory: makes a target that is not connected. Each call makes a new one of the same device.
        hand: moves the joints of an emulated device, see ``DeviceEmulator.guide``. If None, the target's own
            ``hand`` is used. Without either, the clause about motion is skipped.
        unplug: disconnects an open device. Without it, the clause about disconnection is skipped.
        timeout_s: how long the detection of a disconnection may take.
        only: names of the clauses to check, such as ``("stored",)`` while you fix one; empty for all.

    Raises:
        ConformanceError: lists every violated clause: what was observed, why it is wrong, the likely cause.
    """
    clauses = _TargetClauses(factory, hand)
    checklist = Checklist(name_of(factory, lambda target: target.disconnect()), only)
    checklist.run("constructor", lambda: lifecycle.check_constructor(factory, CalibrationTarget))
    if not checklist.run("description", clauses.description):
        checklist.finish()  # the other clauses rely on it
        return
    checklist.run("order", clauses.order)
    if checklist.run("connection", lambda: lifecycle.check_connection(factory)):
        checklist.run("identity", clauses.identity)
        checklist.run("release", clauses.release)
        readable = checklist.run("raw positions", clauses.raw_positions)
        checklist.run("motion", clauses.motion)
        if checklist.run("stored", clauses.stored) and readable:
            checklist.run("store", clauses.store)
            if clauses.keeps:
                checklist.run("connect writes nothing", clauses.connect_writes_nothing)
                checklist.run("refused values", clauses.refused_values)
        checklist.run("misfits", clauses.misfits)
        checklist.run("close", lambda: lifecycle.check_idempotent_close(factory, STATES))
        checklist.run("nothing left", lambda: lifecycle.check_nothing_left(factory, clauses.use))
        checklist.run("instances", clauses.instances)
        if unplug is not None:
            checklist.run(
                "disconnection",
                lambda: lifecycle.check_unplugged(factory, unplug, lambda t: t.raw_positions(), timeout_s),
            )
    checklist.finish()


def _connect_and_release(target: CalibrationTarget) -> None:
    target.connect()
    target.release()


STATES: dict[str, Callable[[CalibrationTarget], object]] = {
    "never connected": lambda target: None,
    "connected": lambda target: target.connect(),
    "released": _connect_and_release,
}


class _TargetClauses:
    """The clauses, one method each. Each method makes its own target."""

    def __init__(self, factory: TargetFactory, hand: Hand | None) -> None:
        self._factory = factory
        self._hand = hand
        self.keeps = True  # until stored() returns None

    @staticmethod
    def use(target: CalibrationTarget) -> None:
        """Use a target as a calibration does until its last step."""
        target.release()
        target.raw_positions()
        target.stored()

    def description(self) -> None:
        """The motors are known without a connection, and a calibration file can store them."""
        with lifecycle.made(self._factory) as target:
            motors = target.motors
        require(
            isinstance(motors, tuple) and bool(motors) and all(isinstance(m, TargetMotor) for m in motors),
            f"motors is {motors!r}",
            why="the calibration table lists the joints before it opens the device",
            cause="motors does not return a tuple of TargetMotor made from the settings",
        )
        for what, values in (("id", [str(m.id) for m in motors]), ("name", [m.joint_name for m in motors])):
            twice = [value for value in values if values.count(value) > 1]
            require(
                not twice,
                f"two motors have the {what} {twice[:1]}",
                why="the file identifies a motor by its id, and messages identify a joint by its name",
                cause="ids or names derive from a value that two motors share",
            )
        for motor in motors:
            check_motor(motor)

    def order(self) -> None:
        """Before connect, only the motors are available."""
        with lifecycle.made(self._factory) as target:
            calls = {"raw_positions()": target.raw_positions, "release()": target.release}
            for when in ("before connect", "after disconnect"):
                for name, call in calls.items():
                    refuses(
                        call,
                        DeviceError,
                        f"{name} {when}",
                        why="a calibration that has lost its device reopens it only when this error says "
                        "that it is closed",
                        cause=f"{name} does not check whether the device is open",
                    )
                target.connect()
                target.disconnect()

    def identity(self) -> None:
        """The identity of a device is the same at each connection."""
        seen = []
        for _ in range(2):
            with lifecycle.opened(self._factory) as target:
                seen.append(target.identity)
        require(
            all(isinstance(identity, str) for identity in seen) and seen[0] == seen[1],
            f"identity is {seen[0]!r} at first and {seen[1]!r} after the device was reopened",
            why="a run compares identities to verify that the calibration belongs to this arm",
            cause="the identity derives from a path or a number that changes with each connection",
        )

    def release(self) -> None:
        """Release can be called repeatedly."""
        with lifecycle.opened(self._factory) as target:
            target.release()
            target.release()
            target.raw_positions()

    def raw_positions(self) -> None:
        """Encoder positions are whole ticks within a turn, one for each motor."""
        with lifecycle.opened(self._factory) as target:
            target.release()
            for _ in range(5):
                check_positions(target.raw_positions(), target.motors)

    def motion(self) -> None:
        """The readings of a joint follow the hand that moves it, and the other joints keep theirs."""
        with lifecycle.opened(self._factory) as target:
            hand = self._hand or target.hand
            if hand is None:
                return
            target.release()
            hand(None, HAND_S / 2)
            time.sleep(HAND_S)
            for index in sorted({0, len(target.motors) - 1}):
                self._watch(target, hand, index)

    def stored(self) -> None:
        """The stored values are complete, or None."""
        with lifecycle.opened(self._factory) as target:
            kept, motors = target.stored(), target.motors
        self.keeps = kept is not None
        if kept is None:
            return
        whole = isinstance(kept, tuple) and len(kept) == len(motors)
        require(
            whole and all(isinstance(value, StoredMotor) for value in kept),
            f"stored() is {kept!r}",
            why="if a write fails, the calibration restores the stored values of each motor",
            cause="stored() omits a motor that does not reply instead of raising DeviceError, or it "
            "returns something other than None for a device that stores nothing",
        )
        for motor, value in zip(motors, kept, strict=True):
            require(
                -motor.largest_offset <= value.homing_offset <= motor.largest_offset
                and 0 <= value.range_min < motor.ticks_per_turn
                and 0 <= value.range_max < motor.ticks_per_turn,
                f"{motor.joint_name} stores {value}",
                why="a run compares offset and range in the file with those of the motor, in ticks",
                cause="stored() does not decode a sign bit or a unit of the register",
            )

    def connect_writes_nothing(self) -> None:
        """Opening and closing leaves the stored values unchanged."""
        with lifecycle.opened(self._factory) as target:
            before = target.stored()
        with lifecycle.opened(self._factory) as target:
            target.release()
            target.raw_positions()
            after = target.stored()
        require(
            before == after,
            f"the motors stored {before}, and {after} after the device was reopened",
            why="until its last step a calibration must leave the old values in the motors, even if its "
            "process is killed",
            cause="connect clears the homing offsets",
        )

    def store(self) -> None:
        """The motor stores the value, and no other motor or encoder position changes."""
        with lifecycle.opened(self._factory) as target:
            old = target.stored()
            motors = target.motors
            if old is None:
                for motor in motors:
                    target.store(motor.id, StoredMotor(1, 2, 3))
                require(
                    target.stored() is None,
                    "stored() returned None before store and returns values after it",
                    why="None means that only the file stores the calibration",
                    cause="the object stores the values instead of the device",
                )
                return
            target.release()
            with kept_in_the_end(self._factory, target, old):
                expected = list(old)
                for index, motor in enumerate(motors):
                    raw = target.raw_positions()
                    expected[index] = sample_value(motor, index)
                    target.store(motor.id, expected[index])
                    check_kept(target, expected, motor)
                    check_still(motors, raw, target.raw_positions(), motor)
                with lifecycle.opened(self._other(target)) as other:
                    found = other.stored()
                require(
                    found == tuple(expected),
                    f"after reopening, the device stores {found}; expected {tuple(expected)}",
                    why="a calibration must persist until the next one, even without power",
                    cause="the object stores the values, or the device keeps them in memory that a restart "
                    "clears",
                )

    def refused_values(self) -> None:
        """An absent motor, and a value that a motor cannot store, are refused before anything is written."""
        with lifecycle.opened(self._factory) as target:
            old, motors = target.stored(), target.motors
            if old is None:
                return
            target.release()
            ids = [motor.id for motor in motors]
            absent = next(number for number in range(LARGEST_ID, -1, -1) if number not in ids)
            with kept_in_the_end(self._factory, target, old):
                refuses(
                    lambda: target.store(absent, old[0]),
                    DeviceError,
                    "store of values of an absent motor",
                    why="the caller restores the old values only if store fails",
                    cause="store sends the write without waiting for a reply",
                )
                too_far = StoredMotor(motors[0].largest_offset + 1, 0, motors[0].ticks_per_turn - 1)
                expected = list(old)
                try:
                    target.store(motors[0].id, too_far)
                    expected[0] = too_far
                except DeviceError:
                    pass
                found = target.stored()
                require(
                    found == tuple(expected),
                    f"after an offset of {too_far.homing_offset} was accepted or refused, the motors store "
                    f"{found}; expected {tuple(expected)}",
                    why="store must write a value completely, or refuse it without a change",
                    cause="store truncates the value to the width of the register, or checks it after "
                    "writing the first register",
                )

    def misfits(self) -> None:
        """Misfits are reported as sentences, without a connection."""
        with lifecycle.made(self._factory) as target:
            motors = [
                MotorCalibration(id=m.id, joint_name=m.joint_name, range_max=m.ticks_per_turn - 1)
                for m in target.motors
            ]
            found = target.misfits(ArmCalibration(motors=tuple(motors)))
        require(
            not isinstance(found, str) and all(isinstance(text, str) and text for text in found),
            f"misfits() returned {found!r}",
            why="joshua calibrate --check prints one line for each text",
            cause="misfits() returns one text instead of a list of texts",
        )

    def instances(self) -> None:
        """Two targets share no state."""
        why = "a robot may have two arms of the same kind"
        cause = "state is kept on the class or in the module instead of the instance"
        with lifecycle.made(self._factory) as first, lifecycle.made(self._factory) as second:
            if lifecycle.both_open(first, second):
                first.disconnect()
                require(second.connected, "closing one closed the other", why=why, cause=cause)
                second.raw_positions()

    def _other(self, target: CalibrationTarget) -> TargetFactory:
        """Make a factory that disconnects the open target, then makes a new one."""

        def make() -> CalibrationTarget:
            target.disconnect()
            return self._factory()

        return make

    @staticmethod
    def _watch(target: CalibrationTarget, hand: Hand, index: int) -> None:
        motors, name = target.motors, target.motors[index].joint_name
        for _ in range(MOTIONS):
            began_s = time.monotonic()
            hand(index, HAND_S)
            asked_s = time.monotonic() - began_s
            ways, longest_s = _ways(target, began_s + HAND_S)
            if max(asked_s, longest_s) < LONGEST_LOOK_S:
                break  # else this machine was stalled
        require(
            asked_s < HAND_S / 2,
            f"hand({index}, {HAND_S}) returned after {asked_s:.1f} s",
            why="the calibration reads the joint while the simulated hand moves it",
            cause="the call makes the motion itself instead of a thread or a process",
        )
        way = ways[index]
        needed = motors[index].ticks_per_turn * SMALLEST_RANGE
        require(
            way >= needed,
            f"the positions of {name} changed by {way} ticks while it was moved through its range",
            why=f"a range below {needed:.0f} ticks is too small to complete a calibration",
            cause="raw_positions repeats an old reading or reads another motor, or ticks_per_turn is wrong",
        )
        others = [other for i, other in enumerate(ways) if i != index]
        allowed = motors[index].ticks_per_turn * MOVED
        require(
            max(others, default=0) <= allowed,
            f"another joint moved by {max(others, default=0)} ticks while {name} was moved",
            why="a calibration rejects two joints that move together",
            cause="readings of two motors are swapped, or the simulated hand does not hold the other joints",
        )


def _ways(target: CalibrationTarget, end_s: float) -> tuple[list[int], float]:
    """The ticks that each joint moves until ``end_s`` and rest, and the longest time between two readings."""
    tracks = [Track(motor.ticks_per_turn) for motor in target.motors]
    places: list[list[int]] = []
    longest_s, last_s = 0.0, time.monotonic()
    still = 0  # looks since a joint moved
    while last_s < end_s or (still < REST_LOOKS and last_s < end_s + OVERTIME_S):
        for track, raw in zip(tracks, target.raw_positions(), strict=True):
            track.follow(raw)
        places.append([track.position for track in tracks])
        time.sleep(LOOK_EVERY_S)
        now_s = time.monotonic()
        longest_s, last_s = max(longest_s, now_s - last_s), now_s
        ways = (abs(new - old) for new, old in zip(places[-1], places[-2:][0], strict=True))
        still = 0 if max(ways) > REST_TICKS else still + 1
    return [max(way) - min(way) for way in zip(*places, strict=True)], longest_s
