"""Modes that plugins bring: chosen by name, checked, planned with their services and topics."""

from __future__ import annotations

from pathlib import Path

from joshua.plan import NodeKind
from joshua.planner.pipeline import PipelineResult, examine
from joshua.planner.request import Purpose, Request
from joshua.plugins import PluginStatus, load_registry

ARM = """robot { actions {
  node { node_name: "arm" node_id: 1
    qos { reliability: BEST_EFFORT }
    publishers { data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50 } }
  action_type: ACTION_SINGLE mock_motor_config { num_motors: 2 position_max: 4095 } } }"""

PATROL = """
    from joshua.modes import ModeSpec, ServiceSpec
    from joshua.plan.graph import ServiceTopic

    def check(context):
        if not context.graph.actuators:
            yield context.error("mode-lacks-actuator", "patrol needs an arm", "robot", remedy="add one")

    def topics(graph, config):
        yield ServiceTopic("/patrol/point", "std_msgs/msg/String", is_publisher=True, rate_hz=1.0)
        for name in graph.published_by_nodes:
            yield ServiceTopic(name, "sensor_msgs/msg/JointState")

    PATROL = ServiceSpec(
        "general.plugin_config", node_name="patrol", behaviour="acme.patrol:Patrol", topics=topics
    )
    SPEC = ModeSpec("patrol", check, services=(PATROL,), duration_s=lambda config: 3.0)

    @hookimpl
    def joshua_specs():
        return [ModeOffer(name="patrol", enum_values=("MODE_PLUGIN",), implementation=__name__ + ":SPEC")]
"""


def robot(folder: Path, mode: str, rest: str = ARM) -> str:
    path = folder / "robot.pbtxt"
    path.write_text(f'general {{ id: "x" mode: {mode} }} {rest}', encoding="utf-8")
    return str(path)


def codes(examination: PipelineResult) -> list[tuple[str, str]]:
    return [(item.code, item.severity.value) for item in examination.diagnostics]


def test_a_mode_of_a_plugin_is_planned_with_its_service_and_its_topics(plugin_folder, tmp_path):
    plugin_folder.add("acme-patrol", PATROL)
    examination = examine(
        Request(robot(tmp_path, 'MODE_PLUGIN plugin_mode: "patrol"'), purpose=Purpose.LAUNCH)
    )
    assert codes(examination) == []
    plan = examination.plan
    assert (plan.mode, plan.duration_s) == ("MODE_PLUGIN", 3.0)
    arm, patrol = plan.nodes
    assert (arm.name, patrol.name, patrol.kind) == ("arm", "patrol", NodeKind.SERVICE)
    assert (patrol.plugin, patrol.behaviour) == ("acme-patrol", "acme.patrol:Patrol")
    assert [(topic.name, topic.rate_hz) for topic in patrol.publishers] == [("/patrol/point", 1.0)]
    (heard,) = patrol.subscriptions
    assert (heard.name, heard.qos.reliability) == ("/arm/joint_states", "BEST_EFFORT")


def test_its_checks_and_unused_blocks_are_reported(plugin_folder, tmp_path):
    plugin_folder.add("acme-patrol", PATROL)
    path = robot(tmp_path, 'MODE_PLUGIN plugin_mode: "patrol"', "test { duration_s: 1 }")
    assert codes(examine(Request(path))) == [("mode-lacks-actuator", "error"), ("block-unused", "note")]


def test_a_mode_whose_plugin_is_missing_is_named_and_refused_at_launch(plugin_folder, tmp_path):
    plugin_folder.add("acme-patrol", PATROL)
    path = robot(tmp_path, 'MODE_PLUGIN plugin_mode: "patrole"')
    assert codes(examine(Request(path))) == [("plugin-missing", "note")]
    (found,) = examine(Request(path, purpose=Purpose.LAUNCH)).errors
    assert (found.code, found.allowed, found.remedy) == (
        "plugin-missing",
        ("patrol",),
        "Did you mean patrol?",
    )
    blocked = Request(
        robot(tmp_path, "MODE_CALIBRATION"), purpose=Purpose.LAUNCH, blocked_plugins=["joshua-calibration"]
    )
    (found,) = examine(blocked).errors
    assert found.code == "plugin-missing"
    assert "joshua-calibration" in found.message


def test_the_fields_of_a_plugins_mode_go_with_it(tmp_path):
    assert codes(examine(Request(robot(tmp_path, "MODE_PLUGIN")))) == [("mode-lacks-field", "error")]
    path = robot(tmp_path, 'MODE_TEST plugin_mode: "patrol"')
    assert codes(examine(Request(path))) == [("field-unused", "note")]


def test_a_broken_mode_is_a_finding_and_no_crash(plugin_folder, tmp_path):
    plugin_folder.add("acme-patrol", PATROL.replace("context.graph.actuators", "context.no_such_thing"))
    path = robot(tmp_path, 'MODE_PLUGIN plugin_mode: "patrol"')
    (found,) = examine(Request(path, purpose=Purpose.LAUNCH)).errors
    assert found.code == "broken-plugin"
    assert "no_such_thing" in found.message


def test_a_plugin_takes_no_mode_of_the_core(plugin_folder):
    plugin_folder.add(
        "acme-test",
        """
        @hookimpl
        def joshua_specs():
            return [ModeOffer(enum_values=("MODE_TEST",), implementation="acme.mode:SPEC")]
        """,
    )
    row = next(row for row in load_registry().rows() if row.distribution == "acme-test")
    assert row.status is PluginStatus.BROKEN
    assert "the core has the others" in row.reasons[0]
