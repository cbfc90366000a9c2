from __future__ import annotations

import queue
import sys
import threading
import time
import types
from collections.abc import Callable
from typing import Any

import pytest
from joshua.devices import sensor_node
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua.devices.sensor import Reading, Sensor
from joshua.devices.sensor_node import SensorNode
from joshua.messages import message_class
from joshua.messages.make import pixels
from joshua.node.errors import Cancelled
from joshua.plan import NodeKind, NodeSpec, TopicSpec
from joshua.schema import config_pb2
from joshua.testing.recording_context import RecordingContext
from joshua_mock.pattern import frame_number
from joshua_mock.settings import MockCameraSettings

IMAGE = "sensor_msgs/msg/Image"


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline, "the condition did not come true in 30 s"
        time.sleep(0.005)


class ScriptedSensor(Sensor):
    """A sensor whose readings and faults come from a queue."""

    script: queue.Queue[Any]
    connections: list[str]
    refusals = 0

    @property
    def data_types(self) -> tuple[str, ...]:
        return ("std_msgs/msg/Int64",)

    @property
    def connected(self) -> bool:
        return bool(self.connections) and self.connections[-1] == "open"

    def connect(self) -> None:
        if type(self).refusals:
            type(self).refusals -= 1
            raise DeviceError("the port is not there")
        self.connections.append("open")

    def read(self, timeout_s: float) -> Reading | None:
        try:
            item = self.script.get(timeout=min(timeout_s, 0.02))
        except queue.Empty:
            return None
        if isinstance(item, Exception):
            raise item
        return Reading(*item)

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        return message_class(type_name)(reading.data)

    def implausible(self, reading: Reading) -> str:
        return "the value is negative" if reading.data < 0 else ""

    def disconnect(self) -> None:
        self.connections.append("closed")


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> Any:
    module = types.ModuleType("joshua_scripted_sensor")
    sensor = type("OneSensor", (ScriptedSensor,), {"script": queue.Queue(), "connections": []})
    module.OneSensor = sensor  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(sensor_node, "RECONNECT_FIRST_S", 0.01)
    monkeypatch.setattr(sensor_node, "SILENCE_S", 3600.0)  # a busy machine is no silent sensor
    return sensor


def scripted_spec(rate_hz: float = 1000.0) -> NodeSpec:
    return NodeSpec(
        name="counter",
        kind=NodeKind.SENSOR,
        behaviour="",
        implementation="joshua_scripted_sensor:OneSensor",
        publishers=(TopicSpec(name="/count", type_name="std_msgs/msg/Int64", rate_hz=rate_hz),),
    )


def start(spec: NodeSpec) -> tuple[RecordingContext, SensorNode]:
    context = RecordingContext(spec)
    node = SensorNode(context)
    node.configure()
    node.activate()
    return context, node


def values(context: RecordingContext) -> list[int]:
    return [message.data for message in context.publishers["/count"].messages]


def end(context: RecordingContext, node: SensorNode) -> None:
    for _ in range(2):
        node.deactivate()
        context.stop()
        node.cleanup()


def test_each_reading_is_published_once(scripted: Any) -> None:
    context, node = start(scripted_spec())
    for number in (0, 1, 1, 0, 2, 5):
        scripted.script.put((number * 10**9 + 1, number, number))
    wait_until(lambda: len(values(context)) == 4)
    end(context, node)
    assert values(context) == [0, 1, 2, 5]
    rows = {check: (passed, measured) for check, passed, measured in node.test_results()}
    assert rows["readings in order"] == (False, "4 new, 2 repeated or out of order, 2 lost")
    assert rows["readings plausible"] == (True, "all")
    assert scripted.connections[-1] == "closed"


def test_the_rate_is_limited(scripted: Any) -> None:
    context, node = start(scripted_spec(rate_hz=10.0))
    for number in range(100):
        scripted.script.put((number * 10_000_000, number, number))
    wait_until(scripted.script.empty)
    end(context, node)
    assert values(context) == list(range(0, 100, 10))


def test_a_lost_connection_is_opened_again(scripted: Any, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    context, node = start(scripted_spec())
    scripted.script.put((10**9, 0, 10))
    scripted.script.put(DeviceDisconnected("the cable is gone"))
    scripted.script.put((2 * 10**9, 0, 20))  # counts from 0 again
    wait_until(lambda: values(context) == [10, 20])
    end(context, node)
    assert scripted.connections[:5] == ["open", "closed", "open", "closed", "closed"]
    assert caplog.messages == [
        "disconnected: the cable is gone; reconnecting",
        "reconnected",
    ]
    assert ("connection", False, "lost 1 times") in node.test_results()


def test_attempts_go_on_until_the_device_is_back(scripted: Any, caplog: pytest.LogCaptureFixture) -> None:
    context, node = start(scripted_spec())
    scripted.refusals = 1
    scripted.script.put(DeviceDisconnected("the cable is gone"))
    scripted.script.put((5, 0, 20))
    wait_until(lambda: values(context) == [20])
    end(context, node)
    assert "still disconnected: the port is not there; next attempt in 0.02 s" in caplog.messages


def test_a_device_that_takes_long_to_open_does_not_pass_for_a_hung_reader(
    scripted: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    class Asked(RecordingContext):
        @property
        def stopping(self) -> bool:
            asked.append(threading.current_thread().name)
            return super().stopping

    monkeypatch.setattr(sys.modules[__name__], "RecordingContext", Asked)
    context, node = start(scripted_spec())
    connect = scripted.connect

    def slow(sensor: ScriptedSensor) -> None:
        before = len(asked)
        wait_until(lambda: len(asked) >= before + 3)
        connect(sensor)

    monkeypatch.setattr(scripted, "connect", slow)
    scripted.script.put(DeviceDisconnected("the cable is gone"))
    scripted.script.put((5, 0, 20))
    wait_until(lambda: values(context) == [20])
    end(context, node)
    assert set(asked) == {"sensor"}


def test_the_stop_ends_the_wait_for_a_device(scripted: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sensor_node, "RECONNECT_FIRST_S", 3600.0)
    context, node = start(scripted_spec())
    scripted.script.put(DeviceDisconnected("the cable is gone"))
    wait_until(lambda: "closed" in scripted.connections)
    end(context, node)


def test_a_driver_can_break_its_search_off_when_the_run_ends(
    scripted: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def search(sensor: ScriptedSensor) -> None:
        wait_until(sensor.context.stopping)
        raise Cancelled

    context, node = start(scripted_spec())
    monkeypatch.setattr(scripted, "connect", search)
    scripted.script.put(DeviceDisconnected("the cable is gone"))
    wait_until(lambda: any(thread.name == "sensor's connection" for thread in threading.enumerate()))
    end(context, node)
    assert context.failures == []

    context = RecordingContext(scripted_spec())
    node = SensorNode(context)
    threading.Timer(0.05, context.stop).start()
    with pytest.raises(Cancelled):  # which the runtime takes for a good end
        node.configure()
    node.cleanup()


def test_silence_is_reported_once(
    scripted: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    monkeypatch.setattr(sensor_node, "SILENCE_S", 0.05)
    context, node = start(scripted_spec())
    wait_until(lambda: len(caplog.messages) == 1)
    time.sleep(0.1)
    assert len(caplog.messages) == 1
    monkeypatch.setattr(sensor_node, "SILENCE_S", 3600.0)  # from now on nothing is a silence
    scripted.script.put((5, 0, 20))
    wait_until(lambda: len(caplog.messages) == 2)
    end(context, node)
    assert caplog.messages == [
        "no reading for 0.05 s: check its cable and power",
        "readings resumed",
    ]


def test_implausible_readings_fail_the_test(scripted: Any) -> None:
    context, node = start(scripted_spec())
    scripted.script.put((5, 0, -1))
    wait_until(lambda: values(context) == [-1])
    end(context, node)
    assert ("readings plausible", False, "the value is negative") in node.test_results()


def test_a_driver_that_crashes_fails_the_node(scripted: Any) -> None:
    context, node = start(scripted_spec())
    scripted.script.put(ZeroDivisionError("a fault of the driver"))
    wait_until(lambda: not any(thread.is_alive() for thread in context._threads))
    with pytest.raises(ZeroDivisionError, match="a fault of the driver"):
        context.stop()
    node.cleanup()


def test_types_that_a_sensor_does_not_offer_are_refused(scripted: Any) -> None:
    spec = scripted_spec().model_copy(
        update={"publishers": (TopicSpec(name="/x", type_name=IMAGE, rate_hz=1.0),)}
    )
    with pytest.raises(
        DeviceError,
        match="/counter cannot publish sensor_msgs/msg/Image on /x: OneSensor offers std_msgs/msg/Int64",
    ):
        SensorNode(RecordingContext(spec)).configure()
    assert scripted.connections == [], "nothing was opened"


def test_subscriptions_have_no_effect_and_that_is_said(scripted: Any) -> None:
    spec = scripted_spec().model_copy(update={"subscriptions": (TopicSpec(name="/in", type_name=IMAGE),)})
    context, node = start(spec)
    end(context, node)
    assert context.warnings == ["/counter: a sensor takes no commands, so /in has no effect"]


def test_a_mock_camera_runs_at_its_rate_without_losing_a_frame() -> None:
    block = config_pb2.MockCameraConfig(width=64, height=48, fps=50)
    spec = NodeSpec(
        name="camera_top",
        kind=NodeKind.SENSOR,
        behaviour="",
        implementation="joshua_mock.sensors:MockCamera",
        settings_type="joshua_mock.settings:MockCameraSettings",
        settings=MockCameraSettings.from_block(block).model_dump(mode="json"),
        frame_id="optical",
        publishers=(TopicSpec(name="/image", type_name=IMAGE, rate_hz=50.0),),
    )
    context, node = start(spec)
    messages = context.publishers["/image"].messages
    wait_until(lambda: len(messages) >= 25)
    end(context, node)
    numbers = [frame_number(pixels(message)) for message in messages]
    assert None not in numbers
    assert numbers == sorted(set(numbers), key=lambda number: number or 0)
    assert messages[0].header.frame_id == "optical"
    rows = {check: passed for check, passed, _ in node.test_results()}
    assert rows["readings in order"]
    assert rows["readings plausible"]


@pytest.mark.parametrize(
    ("topics", "infos"),
    [
        ({"/top/image_raw": "Image"}, ["/top/camera_info"]),
        ({"/top/image_raw": "Image", "/top/image_raw/compressed": "CompressedImage"}, ["/top/camera_info"]),
        ({"/camera_top": "CompressedImage"}, ["/camera_top/camera_info"]),
        ({"/top/image_raw": "Image", "/calibration": "CameraInfo"}, []),
    ],
)
def test_each_picture_has_its_calibration_beside_it(topics: dict[str, str], infos: list[str]) -> None:
    block = config_pb2.MockCameraConfig(width=64, height=48, fps=50)
    spec = NodeSpec(
        name="camera_top",
        kind=NodeKind.SENSOR,
        behaviour="",
        implementation="joshua_mock.sensors:MockCamera",
        settings_type="joshua_mock.settings:MockCameraSettings",
        settings=MockCameraSettings.from_block(block).model_dump(mode="json"),
        frame_id="optical",
        publishers=tuple(
            TopicSpec(name=name, type_name=f"sensor_msgs/msg/{kind}", rate_hz=50.0)
            for name, kind in topics.items()
        ),
    )
    context, node = start(spec)
    wait_until(lambda: all(len(context.publishers[name].messages) > 3 for name in [*topics, *infos]))
    end(context, node)
    assert set(context.publishers) == {*topics, *infos, "/diagnostics"}
    for name in infos:
        stamps = [
            {(message.header.stamp.sec, message.header.stamp.nanosec) for message in publisher.messages}
            for publisher in (context.publishers[name], context.publishers[next(iter(topics))])
        ]
        assert len(stamps[0] & stamps[1]) > 2
        info = context.publishers[name].messages[0]
        assert (info.width, info.height, info.header.frame_id) == (64, 48, "optical")


def diagnosis(context: RecordingContext) -> tuple[int, str, dict[str, str]]:
    context.tick("diagnostics")
    status = context.publishers["/diagnostics"].messages[-1].status[0]
    return status.level, status.message, {pair.key: pair.value for pair in status.values}


def test_diagnostics_tell_a_lost_sensor_from_a_good_one(scripted: Any) -> None:
    context, node = start(scripted_spec())
    scripted.script.put((10**9, 0, 10))
    wait_until(lambda: values(context) == [10])
    assert diagnosis(context) == (
        0, "in order", {"readings": "1", "lost": "0", "repeated": "0", "reconnections": "0"},
    )  # fmt: skip
    scripted.refusals = 10**6
    scripted.script.put(DeviceDisconnected("the cable is gone"))
    wait_until(lambda: diagnosis(context)[0] == 2)
    assert diagnosis(context)[1] == "disconnected: the cable is gone"
    scripted.refusals = 0
    wait_until(lambda: diagnosis(context)[:2] == (0, "in order"))
    end(context, node)


def test_diagnostics_tell_a_silent_sensor(scripted: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sensor_node, "SILENCE_S", 0.05)
    context, node = start(scripted_spec())
    wait_until(lambda: diagnosis(context)[:2] == (3, "no readings: check its cable and power"))
    end(context, node)
