"""What a run shows of itself, word for word."""

from __future__ import annotations

import os
import time

import pytest
from joshua.plan import (
    Diagnostic,
    NodeReport,
    Plan,
    Position,
    RunReport,
    Severity,
    TimerReport,
    TopicReport,
    TopicSpec,
    TransportSettings,
)
from joshua.plan.events import LogEntry, NodeRow, NodeStatus, RunStatus, StartTable
from joshua.plan.foreign_text import printable
from joshua.supervisor.node_record import commanded_by, visible_to
from joshua.supervisor.node_record import start_table as start_table_of
from joshua.supervisor.tables import (
    Cell,
    Screen,
    columns,
    log_line,
    report_lines,
    shorten,
    start_lines,
    status_lines,
)

JOINTS = "sensor_msgs/msg/JointState"


def start_table() -> StartTable:
    return StartTable(
        source="robot.pbtxt",
        mode="MODE_TELEOPERATE",
        robot="arm",
        transport="zenoh (the embedded default), domain 0",
        ready_s=0.421,
        nodes=(
            NodeRow(
                "/leader",
                101,
                "python",
                publishers=(TopicSpec(name="/leader/joint_states", type_name=JOINTS, rate_hz=100.0),),
                warnings=("the latency timer is 16 ms",),
            ),
            NodeRow(
                "/follower",
                12345,
                "native",
                publishers=(TopicSpec(name="/x", type_name=JOINTS, rate_hz=33.333),),
                subscriptions=(TopicSpec(name="/leader/joint_states", type_name=JOINTS),),
            ),
            NodeRow("/quiet", 7, "python"),
        ),
        notes=("log: /tmp/x.jsonl",),
        findings=(
            Diagnostic("code", Severity.WARNING, "nobody listens", position=Position("robot.pbtxt", 3, 5)),
            Diagnostic("code", Severity.NOTE, "the plugin is missing"),
        ),
        visible="on this machine",
    )


def test_the_start_up_table():
    assert "\n".join(start_lines(start_table())) == (
        """\
robot.pbtxt · MODE_TELEOPERATE · arm
transport: zenoh (the embedded default), domain 0
ROS 2 tools: on this machine

NODE       PROCESS  BACKEND  TOPIC                     TYPE                            RATE
/leader        101  python   out /leader/joint_states  sensor_msgs/msg/JointState    100 Hz
/follower    12345  native   out /x                    sensor_msgs/msg/JointState  33.33 Hz
                             in  /leader/joint_states  sensor_msgs/msg/JointState
/quiet           7  python

warning: /leader: the latency timer is 16 ms
warning: robot.pbtxt:3:5: nobody listens
note: the plugin is missing
note: log: /tmp/x.jsonl
all 3 nodes ready after 0.42 s; stop with Ctrl-C"""
    )


def test_a_narrow_terminal_gets_short_types_first_and_then_fewer_columns():
    lines = start_lines(start_table(), Screen(66))
    assert lines[4:8] == [
        "NODE       PROCESS  TOPIC                     TYPE            RATE",
        "/leader        101  out /leader/joint_states  JointState    100 Hz",
        "/follower    12345  out /x                    JointState  33.33 Hz",
        "                    in  /leader/joint_states  JointState",
    ]
    for width in (80, 50, 40):
        assert max(map(len, start_lines(start_table(), Screen(width)))) <= width
    assert any("…joint_states" in line for line in start_lines(start_table(), Screen(40)))


def test_columns_group_drop_shorten_and_wrap_in_this_order():
    rows = [
        ("NODE", "A", "B", "TEXT"),
        ("/first", "1", Cell.of("low", "31"), "some words"),
        ("/first", "2", "b", "others"),
        ("/second", "3", "b", ""),
    ]
    assert columns(rows, screen=Screen(30), group=0, flexible=3)[1] == "/first   1  low  some words"
    assert columns(rows, screen=Screen(22), group=0, drop=(1,), flexible=3) == [
        "  A  B    TEXT",
        "/first",
        "  1  low  some words",
        "  2  b    others",
        "/second",
        "  3  b",
    ]
    assert columns(rows, screen=Screen(15, colour=True), drop=(0, 1), flexible=3)[1] == (
        "\x1b[31mlow\x1b[0m  some words"
    )
    assert columns(rows, screen=Screen(10), drop=(0, 1, 2), flexible=3) == [
        "TEXT",
        "some words",
        "others",
        "",
    ]
    long = [*rows, ("/third", "4", "c", "words " * 20)]
    assert columns(long, screen=Screen(60), drop=(0, 1), flexible=3)[0].split() == ["NODE", "A", "B", "TEXT"]
    assert columns(long, screen=Screen(36), drop=(0, 1), flexible=3)[0].split() == ["A", "B", "TEXT"]
    assert shorten("out /follower/joint_states", 16) == "out /…int_states"


def test_the_live_status_shows_rates_and_what_is_not_ready():
    status = RunStatus(
        "robot.pbtxt",
        "MODE_TEST",
        "running",
        12.4,
        1,
        (
            NodeStatus("/arm", "ready", 1, 0, published_hz={"/arm/joint_states": 99.96, "/arm/goal": 50.0}),
            NodeStatus("/camera", "restarting", 2, 3),
        ),
    )
    assert status_lines(status) == [
        "running 12 s | /arm joint_states 100.0 Hz goal 50.0 Hz | /camera restarting"
    ]
    assert status_lines(status, Screen(40)) == [
        "running 12 s",
        "  /arm joint_states 100.0 Hz goal 50.0…",
        "  /camera restarting",
    ]


def test_a_rate_below_nine_tenths_of_its_target_is_marked():
    node = NodeStatus(
        "/camera",
        "ready",
        1,
        0,
        published_hz={"/a": 26.9, "/b": 27.1, "/diagnostics": 1.0},
        target_hz={"/a": 30.0, "/b": 30.0},
    )
    status = RunStatus("r", "m", "running", 4.0, 1, (node,))
    assert status_lines(status) == ["running 4 s | /camera a 26.9 of 30 Hz! b 27.1 Hz"]
    assert "\x1b[31ma 26.9 of 30 Hz!\x1b[0m" in status_lines(status, Screen(80, colour=True))[0]

    def report(ticks: int) -> list[str]:
        timer = TimerReport(
            name="t",
            period_s=0.1,
            achieved_hz=8.9,
            jitter_p50_s=0.0,
            jitter_p99_s=0.0,
            jitter_p999_s=0.0,
            ticks=ticks,
            overruns=0,
        )
        node = NodeReport(full_name="/camera", state="stopped", timers=(timer,))
        return report_lines(RunReport(exit_code=0, reason="done", nodes=(node,)))

    assert "8.90 Hz!" in report(40)[3]
    assert report(40)[4] == "! below 90% of the target rate"
    assert "8.90 Hz " in report(2)[3], "a run that is too short says nothing about a rate"


def test_the_start_says_who_sees_it():
    zenoh = visible_to(TransportSettings(domain_id=7))
    assert zenoh == (
        "on this machine, with RMW_IMPLEMENTATION=rmw_zenoh_cpp ROS_DOMAIN_ID=7; for other machines, set "
        "transport.listen_endpoints"
    )
    assert "connected to tls/0.0.0.0:7447" in visible_to(
        TransportSettings(listen_endpoints=("tls/0.0.0.0:7447",))
    )
    near = visible_to(TransportSettings(kind="dds"))
    assert near.startswith("on this machine, with ROS_DOMAIN_ID=0, and for Cyclone DDS ROS_AUTOMATIC_")
    assert near.endswith("start with ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET")
    assert visible_to(TransportSettings(kind="dds", discovery_range="SUBNET")) == (
        "in the local network, with ROS_DOMAIN_ID=0 and their default discovery range"
    )
    assert "hides the run" in visible_to(TransportSettings(kind="dds", discovery_range="OFF"))
    limited = TransportSettings(kind="dds", discovery_range="SUBNET", limits="No services: use `joshua call`")
    table = start_table_of(Plan(source="r", mode="m", transport=limited), [], 0.1, ())
    assert table.visible == (
        "in the local network, with ROS_DOMAIN_ID=0 and their default discovery range. No services: use "
        "`joshua call`"
    )


def test_what_a_node_tells_people_comes_first_in_the_status_line():
    nodes = (
        NodeStatus("/arm", "ready", 1, 0, published_hz={"/arm/joint_states": 50.0}),
        NodeStatus("/keyboard", "ready", 2, 0, shown="driving ON: pan +"),
    )
    (line,) = status_lines(RunStatus("r", "m", "running", 4.0, 1, nodes))
    assert line == "running 4 s | /keyboard [driving ON: pan +] | /arm joint_states 50.0 Hz"


def test_an_arm_in_fault_names_the_nodes_whose_commands_it_ignores():
    shown = "5 commands without effect from /leader"
    nodes = (
        NodeStatus(
            "/arm", "fault", 1, 0, shown=shown, reason="too hot", published_hz={"/arm/joint_states": 50.0}
        ),
    )
    (line,) = status_lines(RunStatus("r", "m", "running", 4.0, 1, nodes))
    assert line == f"running 4 s | /arm fault [{shown}]"


def test_the_report_shows_cadence_failures_and_the_reason():
    report = RunReport(
        exit_code=1,
        reason="stopped by SIGINT",
        ready_s=0.4,
        stop_s=0.123,
        nodes=(
            NodeReport(
                full_name="/arm",
                state="stopped",
                restarts=2,
                timers=(
                    TimerReport(
                        name="control",
                        period_s=0.01,
                        achieved_hz=99.987,
                        jitter_p50_s=0.0001,
                        jitter_p99_s=0.0015,
                        jitter_p999_s=0.002,
                        ticks=1000,
                        overruns=4,
                    ),
                ),
                topics=(
                    TopicReport(
                        name="/x",
                        type_name=JOINTS,
                        is_publisher=True,
                        count=9,
                        rate_hz=50.5,
                        configured_hz=50.0,
                        jitter_p50_s=0.001,
                    ),
                    TopicReport(name="/y", type_name=JOINTS, is_publisher=False, count=8, rate_hz=30.0),
                ),
            ),
            NodeReport(full_name="/camera", state="failed", reason="it is\x1b[31m gone"),
            NodeReport(full_name="/hand", state="stopped", reason="joint_1 is too hot", restarts=1),
        ),
    )
    assert "\n".join(report_lines(report)) == (
        """
jitter percentiles in ms
NODE  TIMER OR TOPIC  TARGET  ACHIEVED   P50   P99  P99.9  OVERRUNS  COUNT
/arm  timer control   100 Hz  99.99 Hz  0.10  1.50   2.00         4   1000
/arm  out /x           50 Hz  50.50 Hz  1.00  0.00   0.00                9
/arm  in /y                   30.00 Hz                                   8
/arm: restarted 2 times
/camera: failed: it is\\x1b[31m gone
/hand: restarted once
/hand: fault: joint_1 is too hot
ended with 1: stopped by SIGINT (stopped in 0.12 s)"""
    )


def test_a_run_without_timers_and_topics_shows_no_table():
    report = RunReport(exit_code=0, reason="done", nodes=(NodeReport(full_name="/a", state="stopped"),))
    assert report_lines(report) == ["ended with 0: done"]
    # the checks of a test follow, and may end it with another code
    assert report_lines(report.model_copy(update={"judged": True})) == ["ended: done"]
    failed = report.model_copy(update={"judged": True, "exit_code": 1})
    assert report_lines(failed) == ["ended with 1: done"]


def test_a_log_line_has_local_time_level_and_node(monkeypatch):
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    try:
        entry = LogEntry(1_700_000_000_123_456_789, "/arm", 30, "hot\tmotor\nnext \x07")
        assert log_line(entry) == "22:13:20.123 WARNING /arm: hot\tmotor\nnext \\x07"
        assert log_line(LogEntry(0, "", 20, "x")) == "00:00:00.000 INFO    x"
        long = LogEntry(0, "/follower_arm", 20, "follows /leader_arm: shoulder_pan, elbow_flex\n  at once")
        assert log_line(long, Screen(48)).split("\n") == [
            "00:00:00.000 INFO    /follower_arm: follows",
            "  /leader_arm: shoulder_pan, elbow_flex",
            "  at once",
        ]
    finally:
        monkeypatch.undo()
        time.tzset()


def test_control_characters_are_made_visible():
    assert printable("a\x00\x1b\x7f\x9bz ä\t\n") == "a\\x00\\x1b\\x7f\\x9bz ä\t\n"
    assert printable(os.linesep) == os.linesep


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({}, "from this user and root; other users of this machine can only watch"),
        ({"open_to_local_users": True}, "unprotected: everyone who reaches tcp/localhost:7447 can command"),
        (
            {"listen_endpoints": ("tcp/0.0.0.0:7447",)},
            "unprotected: everyone who reaches tcp/0.0.0.0:7447 can command",
        ),
        (
            {"connect_endpoints": ("tcp/robot.local:7447",)},
            "unprotected: everyone who reaches tcp/localhost:7447, tcp/robot.local:7447 can command",
        ),
        (
            {"listen_endpoints": ("tls/0.0.0.0:7447",)},
            "from everyone with a certificate of the authority in root_ca_file",
        ),
        (
            {"kind": "dds"},
            "unprotected: every user of this machine can command, because DDS without SROS 2 has no access "
            "control",
        ),
        (
            {"kind": "dds", "discovery_range": "SUBNET"},
            "unprotected: everyone in the local network can command, because DDS without SROS 2 has no "
            "access control",
        ),
        ({"discovery_range": "OFF"}, ""),
        ({"kind": "acme"}, ""),
    ],
)
def test_the_start_table_says_who_can_command(values, text):
    assert commanded_by(TransportSettings(**values)) == text
