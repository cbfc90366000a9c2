from __future__ import annotations

import os
import socket
import struct
import threading
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from broken_actuators import (
    AnswersInTicks,
    AsksWithPlainValues,
    AttributeErrorWhenClosed,
    CannotReconnect,
    ClaimsToStop,
    ClampsInPlace,
    ClosesOnce,
    DoesNotHold,
    GoesTheOtherWay,
    HasAVagueVerb,
    IgnoresLimits,
    JumpsAtEnable,
    KeepsItsGoal,
    LeavesAHandle,
    LeavesAThread,
    LimitsInTicks,
    MovesBeyondLimits,
    MovesOnNan,
    NamesNeedConnection,
    NamesTwice,
    NoSpeed,
    OffersAnUnknownType,
    OpensInConstructor,
    ReadsWhenClosed,
    ReleaseNeedsTorque,
    RenamesItsJoints,
    SaysConnectedAtOnce,
    SendsAnotherType,
    SharesItsArray,
    SharesStateOnTheClass,
    SilentError,
    StartsThreadInConstructor,
    StopsNothing,
    StopsWithoutAType,
    SwappedLimits,
    TakesAnyShape,
    TakesNan,
    TellsWhatItWanted,
    WritesWithoutTorque,
    first_stamp_ns,
    leaked_thread_end,
    opened_handles,
    reads,
    settings,
)
from joshua.devices.actuator import Actuator, JointReading
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua.plugins import ActuatorSpec, PluginRow, PluginStatus, Registry
from joshua.schema import config_pb2
from joshua.testing import ConformanceError, actuator_check, check_actuator
from joshua_mock.actuator import MockActuator


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"num_motors": 6, "motion": config_pb2.MOCK_MOTION_SINE},
        {"position_min": 2000, "position_max": 2100},
        {"num_motors": 1, "time_constant_s": 0.2},
    ],
)
def test_the_mock_actuator_conforms(fields: dict[str, Any]) -> None:
    check_actuator(lambda: MockActuator(settings(**fields)))


BROKEN: list[tuple[type[Actuator], str, str]] = [
    (OpensInConstructor, "constructor", "the constructor opened 1 file handle (/dev/null)"),
    (StartsThreadInConstructor, "constructor", "the constructor opened 1 thread (poller)"),
    (SaysConnectedAtOnce, "constructor", "connected is true after the constructor"),
    (HasAVagueVerb, "constructor", "HasAVagueVerb.wave: a verb takes one request at most; annotate it"),
    (
        NamesNeedConnection,
        "description",
        "DeviceError: NamesNeedConnection.joint_names: the device is not open",
    ),
    (NamesTwice, "description", "joint_names ('joint', 'joint') contains a name twice"),
    (LimitsInTicks, "description", "a limit is 4095 rad"),
    (SwappedLimits, "description", "the limits of joint_1 are 1 to -1 rad"),
    (NoSpeed, "description", "the speed limits are [0. 0.]"),
    (ReadsWhenClosed, "order", "read() before connect returned JointReading("),
    (
        AttributeErrorWhenClosed,
        "order",
        "raised AttributeError ('NoneType' object has no attribute 'read') instead of",
    ),
    (SilentError, "order", "read() before connect raised DeviceError without a message"),
    (CannotReconnect, "connection", "DeviceError: already used"),
    (reads(lambda r: r.position_rad), "reading", "read returned ndarray"),
    (
        reads(lambda r: replace(r, position_rad=r.position_rad[:1])),
        "reading",
        "has shape (1,); 2 joints need (2,)",
    ),
    (reads(lambda r: replace(r, position_rad=[0.0, 0.0])), "reading", "read().position_rad is list"),
    (reads(lambda r: replace(r, effort=np.zeros(2, int))), "reading", "read().effort is ndarray of int64"),
    (
        reads(lambda r: replace(r, velocity_rad_s=np.full(2, np.nan))),
        "reading",
        "velocity_rad_s is [nan, nan]",
    ),
    (reads(lambda r: replace(r, position_rad=r.position_rad + 2048)), "reading", "a position is 2048 rad"),
    (reads(lambda r: replace(r, position_rad=r.position_rad + 5)), "reading", "rad beyond its limits"),
    (reads(lambda r: replace(r, stamp_ns=r.stamp_ns / 1)), "stamps", "of type float"),
    (reads(lambda r: replace(r, stamp_ns=time.monotonic_ns())), "stamps", "while the clock shows"),
    (reads(lambda r: replace(r, stamp_ns=r.stamp_ns // 10**9)), "stamps", "while the clock shows"),
    (reads(lambda r: replace(r, stamp_ns=r.stamp_ns + 10**9)), "stamps", "ms after the return of read"),
    (
        reads(lambda r: replace(r, stamp_ns=first_stamp_ns())),
        "stamps",
        "stamp_ns went from ",
    ),
    (SharesItsArray, "own data", "a change of one reading shows in the next"),
    (ClampsInPlace, "own data", "write changed or returned the array that it was given"),
    (WritesWithoutTorque, "torque", "write before enable returned array("),
    (TellsWhatItWanted, "torque read back", "read_torque after release returned {'joint_1': True"),
    (JumpsAtEnable, "enable", "enable moved a joint by 0."),
    (KeepsItsGoal, "enable", "enable after a release during a motion moved a joint by"),
    (reads(lambda r: replace(r, velocity_rad_s=np.degrees(r.velocity_rad_s))), "velocity", "adds up to"),
    (reads(lambda r: replace(r, velocity_rad_s=r.velocity_rad_s / 6.283)), "velocity", "adds up to"),
    (reads(lambda r: replace(r, velocity_rad_s=-r.velocity_rad_s)), "velocity", "joint_1 moved by "),
    (reads(lambda r: replace(r, velocity_rad_s=np.zeros(2))), "velocity", "adds up to 0.000 rad"),
    (IgnoresLimits, "limits", "write of a goal 1 rad above the limits returned one 1.0"),
    (MovesBeyondLimits, "limits", "a joint is 1.000 rad beyond its limits after such goals"),
    (AnswersInTicks, "limits", "write of the present position returned a goal 2048"),
    (TakesNan, "refused goals", "write of NaN returned array("),
    (TakesAnyShape, "refused goals", "write of shape (3,) returned array("),
    (MovesOnNan, "refused goals", "a refused goal moved a joint by"),
    (GoesTheOtherWay, "motion", "rad from its goal after 0.5 s; it had to move 0.20 rad"),
    (DoesNotHold, "hold", "a joint moved on by"),
    (ReleaseNeedsTorque, "release", "release raised DeviceError: no torque to take off (never connected)"),
    (ClosesOnce, "close", "the first disconnect raised OSError: bad file descriptor (never connected)"),
    (LeavesAHandle, "nothing left", "disconnect left 1 file handle (/dev/null)"),
    (LeavesAThread, "nothing left", "disconnect left 1 thread (orphan)"),
    (SharesStateOnTheClass, "instances", "opening one opened the other"),
    (
        RenamesItsJoints,
        "joints",
        "connect changed joint_names from ('joint_1', 'joint_2') to ('found",
    ),
    (StopsWithoutAType, "safe stop", "UntypedStop.run with HOLD returned dict"),
    (StopsNothing, "safe stop", "IdleStop.run with HOLD returned SafeStopResult(joints={'joint_1': 'not "),
    (ClaimsToStop, "safe stop", "every joint should be 'was off'"),
    (AsksWithPlainValues, "safe stop", "safe_stop_request returned dict"),
    (SendsAnotherType, "further messages", "made sensor_msgs/msg/JointState instead of sensor_msgs/msg/Batt"),
    (OffersAnUnknownType, "further messages", "names BATTERY_STATE, which is not a ROS 2 type"),
]


@pytest.mark.parametrize(("broken", "clause", "observed"), BROKEN)
def test_each_violated_clause_is_found(broken: type[Any], clause: str, observed: str) -> None:
    try:
        with pytest.raises(ConformanceError) as caught:
            check_actuator(lambda: broken(settings()), timeout_s=0.5, only=(clause,))
    finally:
        leaked_thread_end.set()
        leaked_thread_end.clear()
        while opened_handles:
            os.close(opened_handles.pop())
    found = [violation for violation in caught.value.violations if violation.clause == clause]
    assert found, str(caught.value)
    assert observed in found[0].observed, str(caught.value)
    assert found[0].why
    assert found[0].cause


def test_the_message_says_what_why_and_the_likely_cause() -> None:
    with pytest.raises(ConformanceError) as caught:
        check_actuator(lambda: DoesNotHold(settings()))
    assert str(caught.value).startswith(
        "DoesNotHold violates 1 clause of its contract:\n\n1. hold: a joint moved on by "
    )
    assert str(caught.value).endswith(
        "   Why it is wrong: hold is the safe state of an arm that must not fall\n"
        "   Likely cause: hold does not set the goal to the present position"
    )


def test_a_device_that_cannot_be_opened_gives_one_finding_and_no_flood() -> None:
    class Absent(MockActuator):
        def connect(self) -> None:
            raise DeviceError("no device on /dev/ttyACM0")

    with pytest.raises(ConformanceError) as caught:
        check_actuator(lambda: Absent(settings()))
    assert [violation.clause for violation in caught.value.violations] == ["order", "connection"]
    assert "no device on /dev/ttyACM0" in str(caught.value)


class LinkedActuator(MockActuator):
    """A mock actuator whose positions come over a stream socket from a far end."""

    far_end: socket.socket
    unplugged = False

    def connect(self) -> None:
        super().connect()
        self.unplugged = False
        self._link, self.far_end = socket.socketpair()
        self._server = threading.Thread(target=self._serve, args=(self.far_end,), daemon=True)
        self._server.start()

    @staticmethod
    def _serve(far_end: socket.socket) -> None:
        with far_end:
            while far_end.recv(1) == b"?":
                far_end.sendall(struct.pack("<Q", time.time_ns()))

    def read(self) -> JointReading:
        reading = super().read()
        try:
            self._link.sendall(b"?")
            answer = self._link.recv(8)
        except OSError as error:
            raise DeviceDisconnected(f"the link is broken: {error}") from error
        if not answer:
            raise DeviceDisconnected("the far end has closed the link")
        return replace(reading, stamp_ns=struct.unpack("<Q", answer)[0])

    def disconnect(self) -> None:
        if self.connected:
            self._link.close()
            self._server.join()
        super().disconnect()


def unplug(device: Any) -> None:
    device.unplugged = True
    device.far_end.shutdown(socket.SHUT_RDWR)


def test_a_device_that_is_unplugged_conforms() -> None:
    check_actuator(lambda: LinkedActuator(settings()), unplug=unplug)


class LeaksTheError(LinkedActuator):
    def read(self) -> JointReading:
        try:
            return super().read()
        except DeviceDisconnected as error:
            raise BrokenPipeError("Broken pipe") from error


class RepeatsTheLast(LinkedActuator):
    def read(self) -> JointReading:
        try:
            return super().read()
        except DeviceDisconnected:
            return MockActuator.read(self)


class DoesNotClean(LinkedActuator):
    def disconnect(self) -> None:
        if self.connected and self.unplugged:
            kept_links.append(self._link)
            MockActuator.disconnect(self)
        super().disconnect()


kept_links: list[socket.socket] = []


@pytest.mark.parametrize(
    ("broken", "observed"),
    [
        (LeaksTheError, "after unplugging, read raised BrokenPipeError: Broken pipe"),
        (RepeatsTheLast, "read still returned 0.5 s after unplugging"),
        (DoesNotClean, "after unplugging, disconnect left 1 file handle (socket:"),
    ],
)
def test_a_device_that_hides_its_disconnection_is_found(broken: type[Any], observed: str) -> None:
    with pytest.raises(ConformanceError) as caught:
        check_actuator(lambda: broken(settings()), unplug=unplug, timeout_s=0.5, only=("disconnection",))
    while kept_links:
        kept_links.pop().close()
    (violation,) = caught.value.violations
    assert violation.clause == "disconnection"
    assert observed in violation.observed


def test_every_clause_has_a_device_that_breaks_it() -> None:
    with pytest.raises(ValueError, match=r"no clause is named speed; clauses: constructor, ") as refused:
        check_actuator(lambda: MockActuator(settings()), only=("speed",))
    clauses = str(refused.value).split("clauses: ")[1].split(", ")
    assert set(clauses) == {clause for _, clause, _ in BROKEN}


def test_a_driver_without_a_safe_stop_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = ActuatorSpec(block="acme.Arm", implementation=f"{MockActuator.__module__}:MockActuator")
    rows = (PluginRow("acme", "acme-arm", "1", PluginStatus.OK, specs=(spec,)),)
    monkeypatch.setattr(actuator_check, "load_registry", lambda: Registry(rows))
    with pytest.warns(UserWarning, match="MockActuator has no safe stop: if this driver dies, the"):
        check_actuator(lambda: MockActuator(settings()), only=("safe stop",))
