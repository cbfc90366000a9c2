"""Runs in good order, and what a run reports."""

from __future__ import annotations

import json
import os

import pytest
from joshua.plan import NodeKind, TopicSpec
from joshua.supervisor.supervisor import Supervisor
from joshua.testing.transport import transport_settings


def topic(name: str, rate_hz: float = 0.0) -> TopicSpec:
    return TopicSpec(name=name, type_name="std_msgs/msg/String", rate_hz=rate_hz)


def test_nodes_exchange_messages_and_stop_in_good_order(robot):
    report = robot.run_until(
        lambda: "listener heard" in robot.noted(),
        # a module that nothing else imports stands for one of settings
        robot.node("Talker", publishers=(topic("/chat", 50.0),), settings_type="colorsys:rgb_to_hsv"),
        robot.node("Listener", subscriptions=(topic("/chat"),)),
    )

    assert report.exit_code == 0, robot.ui.text()
    assert [node.state for node in report.nodes] == ["stopped", "stopped"]
    talker, listener = report.nodes
    assert talker.topics[0].count > 5
    assert talker.topics[0].configured_hz == 50.0
    assert talker.checks[0].passed  # the fork server has imported it
    assert listener.topics[0].count > 0
    assert listener.checks[0].passed
    assert talker.timers[0].name == "talk"
    assert talker.timers[0].ticks > 5
    assert report.ready_s is not None
    assert report.first_message_s is not None
    assert report.stop_s is not None
    assert robot.ui.reports == [report]


def test_a_topic_that_delivered_nothing_in_a_run_of_a_given_length_fails_it(robot):
    late = topic("/seldom", 1.0)  # of which no message was due
    silent = robot.node("Silent", publishers=(topic("/camera/image_raw", 30.0), late, topic("/events")))
    report = robot.run(silent, duration_s=0.5)

    assert report.exit_code == 1
    ending = "the duration of 0.5 s is over, but nothing was published on /camera/image_raw (/silent, 30 Hz)"
    assert report.reason == ending
    assert f"ERROR : {ending}" in robot.ui.text()


def test_a_silent_topic_does_not_fail_a_run_that_a_user_ended(robot):
    silent = robot.node("Silent", publishers=(topic("/camera/image_raw", 1000.0),))
    report = robot.run_until(lambda: robot.ui.tables, silent)

    assert report.exit_code == 0, report.reason


def test_the_table_names_each_node_with_its_process_topics_and_warnings(robot):
    report = robot.run(
        robot.node("Warns", backend="python"), robot.node("Quiet", publishers=(topic("/x", 5.0),))
    )

    assert report.exit_code == 0, robot.ui.text()
    (table,) = robot.ui.tables
    assert [row.full_name for row in table.nodes] == ["/warns", "/quiet"]
    assert len({row.process_id for row in table.nodes} - {0, os.getpid()}) == 2
    assert table.nodes[0].warnings == ("the latency timer is 16 ms: set it to 1 ms",)
    assert table.nodes[1].publishers[0].name == "/x"
    assert "zenoh" in table.transport
    assert any("router" in note for note in table.notes)
    assert report.nodes[0].warnings == table.nodes[0].warnings


def test_no_node_moves_before_every_node_is_configured(robot):
    robot.run(*(robot.node("Quiet", f"node_{index}") for index in range(3)))

    steps = [line.split()[1] for line in robot.noted()]
    assert steps[:3] == ["configure"] * 3
    assert steps[3:6] == ["activate"] * 3
    assert sorted(steps[6:]) == ["cleanup"] * 3 + ["deactivate"] * 3


def test_a_process_group_shares_one_process(robot):
    report = robot.run_until(
        lambda: "two heard" in robot.noted(),
        robot.node("Talker", "one", process_group="sim", publishers=(topic("/chat", 50.0),)),
        robot.node("Listener", "two", process_group="sim", subscriptions=(topic("/chat"),)),
        robot.node("Quiet", "alone"),
    )

    assert report.exit_code == 0, robot.ui.text()
    one, two, alone = robot.ui.tables[0].nodes
    assert one.process_id == two.process_id != alone.process_id
    assert report.nodes[1].checks[0].passed


def test_a_node_in_a_namespace_publishes_below_its_own_name(robot):
    report = robot.run(robot.node("OwnTopic", "arm", namespace="/left"), duration_s=0.3)

    assert report.exit_code == 0, robot.ui.text()
    assert report.nodes[0].full_name == "/left/arm"
    assert report.nodes[0].topics[0].name == "/left/arm/command"
    assert report.reason == "the duration of 0.3 s is over"


@pytest.mark.parametrize("kind", ["zenoh", "dds"])
def test_nodes_and_their_logs_are_those_of_ros_2_nodes(robot, kind):
    robot.transport = transport_settings(
        kind, domain_id=robot.transport.domain_id, listen_endpoints=robot.transport.listen_endpoints
    )
    report = robot.run(
        robot.node("Chats", namespace="/left"),
        robot.node("SeesGraph", settings={"transport": robot.transport.model_dump(mode="json")}),
        duration_s=60.0,
    )

    assert report.exit_code == 0, robot.ui.text()
    assert report.reason == "/seesgraph: seen", report.nodes[1].checks
    lines, nodes, topics = report.nodes[1].checks
    assert topics.measured == "/parameter_events /rosout", "a node that has logged nothing has them too"
    assert "20 left.chats: still here" in lines.measured
    assert "/left/chats" in nodes.measured
    assert "/seesgraph" in nodes.measured


def test_a_node_ends_the_run_when_its_work_is_done(robot):
    report = robot.run(robot.node("EndsRun"), robot.node("Quiet"), duration_s=None)

    assert report.exit_code == 0
    assert report.reason == "/endsrun: calibration is written"
    assert {node.state for node in report.nodes} == {"stopped"}


def test_the_duration_of_the_plan_ends_the_run(robot):
    plan = robot.plan(robot.node("Quiet"), duration_s=0.05)

    report = Supervisor(plan, robot.server, robot.options(), robot.ui).run()

    assert report.exit_code == 0
    assert "0.05 s" in report.reason


def test_a_plan_without_nodes_is_an_error_that_says_so(robot):
    report = robot.run()

    assert report.exit_code == 1
    assert "no nodes" in report.reason


def test_the_live_status_shows_states_and_rates(robot):
    def shown():
        return [
            status
            for status in robot.ui.statuses
            if status.phase == "running" and status.nodes[0].published_hz.get("/chat", 0.0) > 1.0
        ]

    robot.run_until(shown, robot.node("Talker", publishers=(topic("/chat", 50.0),)))

    (node,) = shown()[0].nodes
    assert (node.state, node.restarts) == ("ready", 0)
    json.dumps(shown()[0].as_dict())


def test_the_log_file_holds_every_line_as_json(robot):
    robot.run(robot.node("Warns"))

    (path,) = (robot.folder / "log").glob("*.jsonl")
    records = [json.loads(line) for line in path.read_text().splitlines()]
    assert {"time", "level", "node", "text", "stream"} <= set(records[0])
    warning = next(record for record in records if "latency timer" in record["text"])
    assert (warning["level"], warning["node"]) == ("WARNING", "/warns")


def test_a_failing_user_interface_is_cut_off_and_stops_nothing(robot):
    def fail(_table):
        raise RuntimeError("no such colour")

    robot.ui.on_ready = fail
    report = robot.run(robot.node("Quiet"))

    assert report.exit_code == 0
    (path,) = (robot.folder / "log").glob("*.jsonl")
    assert "no such colour" in path.read_text()


def test_an_actuator_is_told_that_it_was_restarted(robot):
    report = robot.run_until(
        lambda: "ready again" in robot.ui.text(),
        robot.node("Raises", kind=NodeKind.ACTUATOR, settings={"once": True}),
    )

    assert "raises restarted" in robot.noted()
    assert report.nodes[0].restarts == 1
    assert report.nodes[0].state == "stopped"
    assert report.exit_code == 0, robot.ui.text()


def test_nodes_keep_the_order_of_the_plan(robot):
    names = ["c", "a", "b"]
    report = robot.run(*(robot.node("Quiet", name) for name in names))

    assert [node.full_name for node in report.nodes] == ["/c", "/a", "/b"]


@pytest.mark.parametrize(
    ("behaviour", "facts"),
    [("SlowStart", {}), ("SlowLoad", {}), ("SlowStart", {"ready_timeout_s": 200.0})],
    ids=["hangs", "computes", "declares-its-time"],
)
def test_no_start_outlives_the_duration(robot, behaviour, facts):
    slow = robot.node(behaviour, facts=facts)
    report = robot.run(slow, robot.node("Quiet"), duration_s=1.0, start_timeout_s=None)

    assert report.exit_code == 1
    assert f"{slow.full_name}: not ready after 1 s: it is still " in report.reason
    assert report.reason.endswith("Allow a longer start with --start-timeout SECONDS")
    assert robot.ui.tables == []


def test_a_start_may_take_longer_if_the_user_says_so(robot):
    report = robot.run(robot.node("SlowLoad"), duration_s=0.3, start_timeout_s=60.0)

    assert report.exit_code == 0
    assert "slowload activate" in robot.noted()
