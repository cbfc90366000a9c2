from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from broken_actuators import first_stamp_ns
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua.devices.sensor import Reading, Sensor
from joshua.messages import message_class
from joshua.messages.make import header
from joshua.schema import config_pb2
from joshua.testing import ConformanceError, check_sensor
from joshua_mock.sensors import MockCamera, MockEncoder, MockLidar
from joshua_mock.settings import MockCameraSettings, MockEncoderSettings, MockLidarSettings

CAMERA = MockCameraSettings.from_block(config_pb2.MockCameraConfig(width=32, height=32, fps=200))
NODE = config_pb2.Node()
NODE.publishers.add(publish_rate_hz=100.0)


def encoder() -> MockEncoder:
    return MockEncoder(MockEncoderSettings.from_block(config_pb2.MockEncoderConfig(resolution=4096), NODE))


def lidar() -> MockLidar:
    block = config_pb2.MockLidarConfig(angle_min=-3, angle_max=3, range_min=1.6, range_max=2)
    return MockLidar(MockLidarSettings.from_block(block, NODE))


@pytest.mark.parametrize(
    "factory", [lambda: MockCamera(CAMERA), encoder, lidar], ids=["camera", "encoder", "lidar"]
)
def test_the_mock_sensors_conform(factory: Callable[[], Sensor]) -> None:
    check_sensor(factory)


class OpensInConstructor(MockCamera):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        opened_handles.append(os.open(os.devnull, os.O_RDONLY))


class ListsItsTypes(MockCamera):
    data_types: Any = ["sensor_msgs/msg/Image"]  # noqa: RUF012 (the fault that is to be found)


class EnumNames(MockCamera):
    data_types: Any = ("IMAGE",)


class ReadsWhenClosed(MockCamera):
    def read(self, timeout_s: float) -> Reading | None:
        return super().read(timeout_s) if self.connected else None


class StaysConnected(MockCamera):
    was_open = False

    def connect(self) -> None:
        super().connect()
        self.was_open = True

    @property
    def connected(self) -> bool:
        return self.was_open


class ReadChanged(MockCamera):
    change: Callable[[Reading], Any]

    def read(self, timeout_s: float) -> Any:
        reading = super().read(timeout_s)
        return reading and type(self).change(reading)


def reads(change: Callable[[Any], Any]) -> type[ReadChanged]:
    return type("ReadChanged", (ReadChanged,), {"change": staticmethod(change)})


class DeliversNothing(MockCamera):
    def read(self, timeout_s: float) -> Reading | None:
        self.require_connected("read")
        time.sleep(timeout_s)
        return None


class NeverPlausible(MockCamera):
    def implausible(self, reading: Reading) -> str:
        return "too dark"


class RepeatsTheNewest(MockCamera):
    kept: Reading | None = None

    def read(self, timeout_s: float) -> Reading | None:
        self.kept = super().read(0.0) or self.kept
        return self.kept


class OneBuffer(MockCamera):
    def read(self, timeout_s: float) -> Reading | None:
        reading = super().read(timeout_s)
        if reading is None:
            return None
        if not hasattr(self, "buffer"):
            self.buffer = np.empty_like(reading.data)
        self.buffer[:] = reading.data
        return replace(reading, data=self.buffer)


class WrongType(MockCamera):
    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        return super().message(reading, "sensor_msgs/msg/Image", frame_id)


class StampsThePublication(MockCamera):
    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        message = super().message(reading, type_name, frame_id)
        message.header = header(frame_id)
        return message


class ForgetsTheFrame(MockCamera):
    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        return super().message(reading, type_name, "")


class CannotBeSent(MockCamera):
    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        message = super().message(reading, type_name, frame_id)
        message.header.frame_id = None
        return message


class IgnoresTheTimeout(MockCamera):
    def read(self, timeout_s: float) -> Reading | None:
        time.sleep(0.7)
        return super().read(timeout_s)


class ClosesOnce(MockCamera):
    def disconnect(self) -> None:
        if not self.connected:
            raise OSError("bad file descriptor")
        super().disconnect()


class LeavesAThread(MockCamera):
    def connect(self) -> None:
        super().connect()
        threading.Thread(target=leaked_thread_end.wait, name="grabber", daemon=True).start()


class SharesTheDevice(MockCamera):
    shared: dict[str, Any] = {}  # noqa: RUF012 (the fault that is to be found)

    def connect(self) -> None:
        super().connect()
        self.shared["open"] = True

    def read(self, timeout_s: float) -> Reading | None:
        if self.connected and "open" not in self.shared:
            raise DeviceDisconnected("somebody closed the library")
        return super().read(timeout_s)

    def disconnect(self) -> None:
        super().disconnect()
        self.shared.clear()


opened_handles: list[int] = []
leaked_thread_end = threading.Event()

BROKEN: list[tuple[type[Sensor], str, str]] = [
    (OpensInConstructor, "constructor", "the constructor opened 1 file handle (/dev/null)"),
    (ListsItsTypes, "description", "data_types is ['sensor_msgs/msg/Image']"),
    (EnumNames, "description", "data_types names IMAGE, which is not a ROS 2 type"),
    (ReadsWhenClosed, "order", "read(0) before connect returned None instead of raising DeviceError"),
    (StaysConnected, "connection", "connected is true after disconnect"),
    (reads(lambda r: r.data), "reading", "read returned ndarray"),
    (reads(lambda r: replace(r, sequence=1.5)), "reading", "sequence is 1.5"),
    (DeliversNothing, "reading", "no reading in 0.5 s"),
    (NeverPlausible, "reading", "implausible returned 'too dark' for a reading of a healthy device"),
    (RepeatsTheNewest, "sequence", "sequence went from"),
    (reads(lambda r: replace(r, stamp_ns=float(r.stamp_ns))), "stamps", "of type float"),
    (reads(lambda r: replace(r, stamp_ns=time.monotonic_ns())), "stamps", "while the clock shows"),
    (reads(lambda r: replace(r, stamp_ns=first_stamp_ns())), "stamps", "stamp_ns went from "),
    (OneBuffer, "own data", "the data of a reading changed when later ones were read"),
    (
        WrongType,
        "messages",
        "message made sensor_msgs/msg/Image instead of sensor_msgs/msg/CompressedImage",
    ),
    (StampsThePublication, "messages", "its acquisition was at"),
    (ForgetsTheFrame, "messages", "sensor_msgs/msg/Image has frame_id ''"),
    (CannotBeSent, "messages", "MessageError"),
    (IgnoresTheTimeout, "timeout", "read(0) returned after "),
    (ClosesOnce, "close", "the first disconnect raised OSError: bad file descriptor (never connected)"),
    (LeavesAThread, "nothing left", "disconnect left 1 thread (grabber)"),
    (
        SharesTheDevice,
        "instances",
        "closing one broke the other: DeviceDisconnected: somebody closed the library",
    ),
]


@pytest.mark.parametrize(("broken", "clause", "observed"), BROKEN)
def test_each_violated_clause_is_found(broken: type[Any], clause: str, observed: str) -> None:
    try:
        with pytest.raises(ConformanceError) as caught:
            check_sensor(lambda: broken(CAMERA), timeout_s=0.5, only=(clause,))
    finally:
        leaked_thread_end.set()
        leaked_thread_end.clear()
        while opened_handles:
            os.close(opened_handles.pop())
    (violation,) = caught.value.violations
    assert violation.clause == clause
    assert observed in violation.observed, str(caught.value)
    assert violation.why
    assert violation.cause


def test_every_clause_has_a_sensor_that_breaks_it() -> None:
    with pytest.raises(ValueError, match="no clause is named rate; clauses: constructor, ") as refused:
        check_sensor(lambda: MockCamera(CAMERA), only=("rate",))
    clauses = str(refused.value).split("clauses: ")[1].split(", ")
    assert set(clauses) == {clause for _, clause, _ in BROKEN}


class FileSensor(Sensor):
    """Reads numbers from a pipe, whose far end the test closes."""

    writer = -1

    @property
    def data_types(self) -> tuple[str, ...]:
        return ("std_msgs/msg/Int64",)

    @property
    def connected(self) -> bool:
        return self.writer >= 0

    def connect(self) -> None:
        self.reader, self.writer = os.pipe()
        self.far_end_open = True
        self.count = -1

    def read(self, timeout_s: float) -> Reading | None:
        self.require_connected("read")
        if self.far_end_open:
            os.write(self.writer, b"x")
        if not os.read(self.reader, 1):
            raise DeviceDisconnected("the far end of the pipe is closed")
        self.count += 1
        return Reading(time.time_ns(), self.count, self.count)

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        return message_class(type_name)(reading.data)

    def disconnect(self) -> None:
        if self.connected:
            os.close(self.reader)
            if self.far_end_open:
                os.close(self.writer)
            self.writer = -1


def close_far_end(sensor: Any) -> None:
    os.close(sensor.writer)
    sensor.far_end_open = False


class HidesTheEnd(FileSensor):
    def read(self, timeout_s: float) -> Reading | None:
        try:
            return super().read(timeout_s)
        except DeviceDisconnected:
            return None


class CallsItAFault(FileSensor):
    def read(self, timeout_s: float) -> Reading | None:
        try:
            return super().read(timeout_s)
        except DeviceDisconnected as error:
            raise DeviceError("unknown fault") from error


def test_a_sensor_that_is_unplugged_conforms() -> None:
    check_sensor(lambda: FileSensor(None), unplug=close_far_end)


@pytest.mark.parametrize(
    ("broken", "observed"),
    [
        (HidesTheEnd, "read still returned 0.5 s after unplugging"),
        (CallsItAFault, "after unplugging, read raised DeviceError: unknown fault"),
    ],
)
def test_a_sensor_that_hides_its_disconnection_is_found(broken: type[Any], observed: str) -> None:
    with pytest.raises(ConformanceError) as caught:
        check_sensor(lambda: broken(None), unplug=close_far_end, timeout_s=0.5, only=("disconnection",))
    assert observed in caught.value.violations[0].observed
