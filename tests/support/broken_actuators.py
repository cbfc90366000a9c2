"""Actuators that each break one clause of the conformance check."""

from __future__ import annotations

import functools
import os
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from joshua.devices.actuator import JointLimits, JointReading
from joshua.devices.errors import DeviceError
from joshua.guardian.safe_stop import SafeStopRequest, SafeStopResult
from joshua.messages.make import joint_state
from joshua.node.verbs import verb
from joshua.schema import config_pb2
from joshua_mock.actuator import MockActuator
from joshua_mock.settings import MockMotorSettings


def settings(**fields: Any) -> MockMotorSettings:
    return MockMotorSettings.from_block(
        config_pb2.MockMotorConfig(**{"num_motors": 2, "position_max": 4095, **fields})
    )


class OpensInConstructor(MockActuator):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.handle = os.open(os.devnull, os.O_RDONLY)

    def disconnect(self) -> None:
        super().disconnect()
        if self.handle is not None:
            os.close(self.handle)
            self.handle = None  # type: ignore[assignment]


class StartsThreadInConstructor(MockActuator):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.end = threading.Event()
        self.thread = threading.Thread(target=self.end.wait, name="poller", daemon=True)
        self.thread.start()

    def disconnect(self) -> None:
        super().disconnect()
        self.end.set()
        self.thread.join()


class HasAVagueVerb(MockActuator):
    @verb(moves=False)
    def wave(self, times) -> str:  # type: ignore[no-untyped-def]
        return f"waved {times}"


class SaysConnectedAtOnce(MockActuator):
    @property
    def connected(self) -> bool:
        return True


class NamesNeedConnection(MockActuator):
    @property
    def joint_names(self) -> tuple[str, ...]:
        self.require_connected("joint_names")
        return super().joint_names


class NamesTwice(MockActuator):
    @property
    def joint_names(self) -> tuple[str, ...]:
        return ("joint", "joint")


class LimitsInTicks(MockActuator):
    @property
    def limits(self) -> JointLimits:
        return JointLimits(np.zeros(2), np.full(2, 4095.0), np.ones(2))


class SwappedLimits(MockActuator):
    @property
    def limits(self) -> JointLimits:
        return JointLimits(np.ones(2), -np.ones(2), np.ones(2))


class NoSpeed(MockActuator):
    @property
    def limits(self) -> JointLimits:
        return replace(super().limits, velocity_max_rad_s=np.zeros(2))


class ReadsWhenClosed(MockActuator):
    def read(self) -> JointReading:
        if not self.connected:
            return JointReading(time.time_ns(), np.zeros(2), np.zeros(2), np.zeros(2))
        return super().read()


class AttributeErrorWhenClosed(MockActuator):
    def read(self) -> JointReading:
        if not self.connected:
            raise AttributeError("'NoneType' object has no attribute 'read'")
        return super().read()


class SilentError(MockActuator):
    def read(self) -> JointReading:
        if not self.connected:
            raise DeviceError
        return super().read()


class CannotReconnect(MockActuator):
    count = 0

    def connect(self) -> None:
        self.count += 1
        if self.count > 1:
            raise DeviceError("already used")
        super().connect()


class ReadChanged(MockActuator):
    change: Callable[[JointReading], JointReading]

    def read(self) -> JointReading:
        return type(self).change(super().read())


def reads(change: Callable[[Any], Any]) -> type[ReadChanged]:
    return type("ReadChanged", (ReadChanged,), {"change": staticmethod(change)})


class SharesItsArray(MockActuator):
    def read(self) -> JointReading:
        reading = super().read()
        if not hasattr(self, "buffer"):
            self.buffer = np.zeros(2)
        self.buffer += reading.position_rad - np.where(np.abs(self.buffer) > 100, 0, self.buffer)
        return replace(reading, position_rad=self.buffer)


class ClampsInPlace(MockActuator):
    def write(self, goal_rad: Any) -> Any:
        super().write(goal_rad)
        return goal_rad


class WritesWithoutTorque(MockActuator):
    def write(self, goal_rad: Any) -> Any:
        if self.connected and not self._energised:
            return self.checked_goal(goal_rad)
        return super().write(goal_rad)


class TellsWhatItWanted(MockActuator):
    """The kind of read-back that makes an e-stop lie."""

    def read_torque(self) -> dict[str, bool]:
        return dict.fromkeys(self.joint_names, True)


class JumpsAtEnable(MockActuator):
    def enable(self) -> None:
        super().enable()
        self._goal = self._goal + 0.5


class KeepsItsGoal(MockActuator):
    def enable(self) -> None:
        goal = self._goal
        super().enable()
        self._goal = goal


class IgnoresLimits(MockActuator):
    def write(self, goal_rad: Any) -> Any:
        super().write(goal_rad)
        return self.checked_goal(goal_rad)


class MovesBeyondLimits(MockActuator):
    def write(self, goal_rad: Any) -> Any:
        written = super().write(goal_rad)
        if np.abs(np.asarray(goal_rad) - written).max() > 0.5:
            self._position = self._goal = np.asarray(goal_rad, float)
        return written

    def hold(self) -> None:
        self.require_connected("hold")

    def read(self) -> JointReading:
        return replace(super().read(), position_rad=self._position.copy())


class AnswersInTicks(MockActuator):
    def write(self, goal_rad: Any) -> Any:
        return super().write(goal_rad) * 651.9 + 2048


class TakesNan(MockActuator):
    def checked_goal(self, goal_rad: Any) -> Any:
        return np.nan_to_num(np.array(goal_rad, float), posinf=0.0)


class TakesAnyShape(MockActuator):
    def write(self, goal_rad: Any) -> Any:
        goal = np.resize(np.array(goal_rad, float), 2)
        return super().write(goal)


class MovesOnNan(MockActuator):
    def checked_goal(self, goal_rad: Any) -> Any:
        if not np.isfinite(np.asarray(goal_rad)).all():
            self._goal = self._goal + 0.6
        return super().checked_goal(goal_rad)


class GoesTheOtherWay(MockActuator):
    def write(self, goal_rad: Any) -> Any:
        goal = self.checked_goal(goal_rad)
        written = super().write(goal)
        self._goal = -self._goal
        return written


class DoesNotHold(MockActuator):
    def hold(self) -> None:
        self.require_connected("hold")


class ReleaseNeedsTorque(MockActuator):
    def release(self) -> None:
        if not self._energised:
            raise DeviceError("no torque to take off")
        super().release()


class ClosesOnce(MockActuator):
    def disconnect(self) -> None:
        if not self.connected:
            raise OSError("bad file descriptor")
        super().disconnect()


class LeavesAHandle(MockActuator):
    def connect(self) -> None:
        super().connect()
        self.leaked = os.open(os.devnull, os.O_RDONLY)
        opened_handles.append(self.leaked)


class LeavesAThread(MockActuator):
    def connect(self) -> None:
        super().connect()
        threading.Thread(target=leaked_thread_end.wait, name="orphan", daemon=True).start()


class SharesStateOnTheClass(MockActuator):
    open_ports: set[str] = set()  # noqa: RUF012 (the fault that is to be found)

    @property
    def connected(self) -> bool:
        return bool(self.open_ports)

    def connect(self) -> None:
        self._connected = False
        super().connect()
        self.open_ports.add("port")

    def disconnect(self) -> None:
        super().disconnect()
        self.open_ports.clear()


class RenamesItsJoints(MockActuator):
    def connect(self) -> None:
        super().connect()
        self._joint_names = tuple(f"found_{name}" for name in self.joint_names)


class UntypedStop(SafeStopRequest):
    def run(self) -> Any:
        return {"complete": True, "joints": {"joint_1": "released"}}


class StopsWithoutAType(MockActuator):
    def safe_stop_request(self, action: str, **values: Any) -> UntypedStop:
        return UntypedStop(action)


class IdleStop(SafeStopRequest):
    def run(self) -> SafeStopResult:
        return SafeStopResult({"joint_1": "not verified"}, detail="no answer")


class LyingStop(SafeStopRequest):
    def run(self) -> SafeStopResult:
        return SafeStopResult({"joint_1": "held" if self.action == "HOLD" else "released"}, self.action)


class ClaimsToStop(MockActuator):
    def safe_stop_request(self, action: str, **values: Any) -> LyingStop:
        return LyingStop(action)


class StopsNothing(MockActuator):
    def safe_stop_request(self, action: str, **values: Any) -> IdleStop:
        return IdleStop(action)


class AsksWithPlainValues(MockActuator):
    def safe_stop_request(self, action: str, **values: Any) -> Any:
        return {"action": action}


class SendsAnotherType(MockActuator):
    @property
    def further_types(self) -> tuple[str, ...]:
        return ("sensor_msgs/msg/BatteryState",)

    def further_message(self, type_name: str, frame_id: str) -> Any:
        return joint_state(["battery"], [8.1], frame_id=frame_id)


class OffersAnUnknownType(MockActuator):
    @property
    def further_types(self) -> tuple[str, ...]:
        return ("BATTERY_STATE",)


@functools.cache
def first_stamp_ns() -> int:
    """The time of the first call, in the test itself: a stamp that is minutes old breaks another clause."""
    return time.time_ns()


opened_handles: list[int] = []
leaked_thread_end = threading.Event()
