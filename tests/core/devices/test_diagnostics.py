"""What the nodes of actuators and sensors say on ``/diagnostics``."""

from __future__ import annotations

from typing import Any

import pytest
from joshua.devices.actuator_node import ActuatorNode
from joshua.devices.diagnostics import DiagnosticStatus, diagnostic_array
from joshua.messages import decode, encode
from joshua.plan import NodeKind, NodeSpec, TopicSpec
from joshua.schema import config_pb2
from joshua.testing.recording_context import RecordingContext
from joshua_mock.settings import MockMotorSettings

STATE = TopicSpec(name="/arm/state", type_name="sensor_msgs/msg/JointState", rate_hz=100.0)


def actuator() -> tuple[RecordingContext, ActuatorNode]:
    settings = MockMotorSettings.from_block(config_pb2.MockMotorConfig(num_motors=2, position_max=4095))
    spec = NodeSpec(
        name="arm",
        namespace="/left",
        kind=NodeKind.ACTUATOR,
        role="ACTION_LEADER",
        block="mock_motor_config",
        behaviour="",
        implementation="joshua_mock.actuator:MockActuator",
        settings_type="joshua_mock.settings:MockMotorSettings",
        settings=settings.model_dump(mode="json"),
        publishers=(STATE,),
    )
    context = RecordingContext(spec)
    node = ActuatorNode(context)
    node.configure()
    node.activate()
    return context, node


def test_rows_survive_the_wire_and_bear_the_name_of_their_node() -> None:
    rows = [
        DiagnosticStatus(DiagnosticStatus.OK, "", "in order", "usb:1"),
        DiagnosticStatus(DiagnosticStatus.WARN, "pan", "hot", "usb:1 id 1", {"temperature_c": "61"}),
    ]
    message = decode("diagnostic_msgs/msg/DiagnosticArray", encode(diagnostic_array("/left/arm", rows)))
    assert [status.name for status in message.status] == ["left/arm", "left/arm: pan"]
    assert [status.level for status in message.status] == [0, 1]
    assert (message.status[1].values[0].key, message.status[1].values[0].value) == ("temperature_c", "61")
    assert message.header.stamp.sec > 0


def test_an_actuator_reports_itself_and_its_joints_once_a_second() -> None:
    context, node = actuator()
    assert context.timers["diagnostics"][0] == 1.0
    context.tick("control")
    context.tick("diagnostics")
    (message,) = context.publishers["/diagnostics"].messages
    assert [status.name for status in message.status] == [
        "left/arm",
        "left/arm: joint_1",
        "left/arm: joint_2",
    ]
    assert message.status[0].message == "in order: read only"
    values: dict[str, Any] = {pair.key: pair.value for pair in message.status[1].values}
    assert float(values["position_rad"]) == pytest.approx(0.0, abs=1e-3)
    assert set(values) == {"position_rad", "velocity_rad_s", "effort"}
    node.deactivate()
    node.cleanup()


def test_rows_of_a_driver_take_the_place_of_the_general_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    context, node = actuator()
    rows = [DiagnosticStatus(DiagnosticStatus.WARN, "bus", "2 replies lost", "usb:1")]
    monkeypatch.setattr(node._actuator, "diagnostics", lambda: rows)
    context.tick("control")
    context.tick("diagnostics")
    (message,) = context.publishers["/diagnostics"].messages
    assert [(status.name, status.message) for status in message.status][1:] == [
        ("left/arm: bus", "2 replies lost")
    ]
