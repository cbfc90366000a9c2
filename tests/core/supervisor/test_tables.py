"""What a run shows of itself, word for word."""

from __future__ import annotations

import os
import time

from joshua.plan import (
    Diagnostic,
    NodeReport,
    Position,
    RunReport,
    Severity,
    TimerReport,
    TopicReport,
    TopicSpec,
)
from joshua.plan.events import LogEntry, NodeRow, NodeStatus, RunStatus, StartTable
from joshua.supervisor.tables import clean, log_line, report_lines, start_lines, status_line

JOINTS = "sensor_msgs/msg/JointState"


def test_the_start_up_table():
    table = StartTable(
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
    )
    assert "\n".join(start_lines(table)) == (
        """\
robot.pbtxt · MODE_TELEOPERATE · arm
transport: zenoh (the embedded default), domain 0

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
    assert status_line(status) == (
        "running 12 s | /arm joint_states 100.0 Hz goal 50.0 Hz | /camera restarting"
    )


def test_what_a_node_tells_people_comes_first_in_the_status_line():
    nodes = (
        NodeStatus("/arm", "ready", 1, 0, published_hz={"/arm/joint_states": 50.0}),
        NodeStatus("/keyboard", "ready", 2, 0, shown="driving ON: pan +"),
    )
    line = status_line(RunStatus("r", "m", "running", 4.0, 1, nodes))
    assert line == "running 4 s | /keyboard [driving ON: pan +] | /arm joint_states 50.0 Hz"


def test_the_report_shows_cadence_failures_and_the_reason():
    report = RunReport(
        exit_code=1,
        reason="stopped by SIGINT",
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
NODE  CADENCE OF       SET  ACHIEVED  JITTER p50      p99    p99.9  OVERRUNS  COUNT
/arm  timer control  100 Hz  99.99 Hz     0.10 ms  1.50 ms  2.00 ms         4   1000
""".replace("CADENCE OF       SET", "CADENCE OF        SET")
        + """\
/arm  out /x          50 Hz  50.50 Hz     1.00 ms  0.00 ms  0.00 ms                9
/arm  in /y                  30.00 Hz                                              8
/arm: started again 2 times
/camera: failed: it is\\x1b[31m gone
/hand: started again once
/hand: in fault: joint_1 is too hot
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
    finally:
        monkeypatch.undo()
        time.tzset()


def test_control_characters_are_made_visible():
    assert clean("a\x00\x1b\x7f\x9bz ä\t\n") == "a\\x00\\x1b\\x7f\\x9bz ä\t\n"
    assert clean(os.linesep) == os.linesep
