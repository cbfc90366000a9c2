"""Small values of the supervisor: groups, records, stacks."""

from __future__ import annotations

import json

from joshua.ipc.messages import Topics
from joshua.plan import NodeKind, NodeReport, NodeSpec, TopicSpec
from joshua.plan.events import LogEntry
from joshua.supervisor.managed_process import StackDump
from joshua.supervisor.node_record import NodeRecord, priority_notes
from joshua.supervisor.policies import LadderTimes, ladder_times, ready_timeout_s
from joshua.supervisor.supervisor import process_groups


def node(name, **fields):
    return NodeSpec(name=name, kind=NodeKind.SENSOR, behaviour="a:B", implementation="", **fields)


def test_nodes_of_a_group_share_a_process_in_start_order():
    nodes = [node("a"), node("b", process_group="g"), node("c"), node("d", process_group="g")]
    groups = [[spec.name for spec in group] for group in process_groups(nodes)]
    assert groups == [["a"], ["b", "d"], ["c"]]


def test_a_group_named_like_a_node_is_still_another_process():
    nodes = [node("a"), node("b", process_group="/a")]
    assert len(process_groups(nodes)) == 2


def test_a_node_can_ask_for_more_time():
    specs = (node("a", facts={"stop_timeout_s": 8, "ready_timeout_s": 90.0}), node("b"))
    assert ladder_times(specs, LadderTimes(3.0, 1.0)) == LadderTimes(8.0, 1.0)
    assert ladder_times(specs[1:], LadderTimes(3.0, 1.0)) == LadderTimes(3.0, 1.0)
    assert ready_timeout_s(specs[0]) == 90.0
    assert ready_timeout_s(specs[1]) == 20.0


def record():
    topic = TopicSpec(name="/x", type_name="std_msgs/msg/String", rate_hz=10.0)
    return NodeRecord(node("a", publishers=(topic,), subscriptions=(topic,)))


def totals(seconds, count):
    return Topics(
        node="/a", stamp_ns=round(seconds * 1e9), published={"/x": count}, received={"/x": count * 2}
    )


def test_rates_are_those_of_the_last_seconds():
    made = record()
    assert made.status().published_hz == {}
    for second, count in ((0, 0), (1, 100), (2, 110), (3, 120), (4, 130), (5, 140)):
        made.count(totals(second, count))
    status = made.status()
    assert status.published_hz == {"/x": 10.0}
    assert status.received_hz == {"/x": 20.0}


def test_a_node_that_left_no_report_is_reported_from_its_totals():
    made = record()
    made.count(totals(10, 1))
    made.count(totals(14, 41))
    made.warnings.append("w")
    made.fail("it is gone", 1)
    made.fail("a later reason", 4)
    report = made.final_report()
    assert (report.state, report.reason, report.warnings) == ("failed", "it is gone", ("w",))
    out, into = report.topics
    assert (out.count, out.rate_hz, out.is_publisher, out.configured_hz) == (41, 10.0, True, 10.0)
    assert (into.count, into.is_publisher) == (82, False)


def test_the_report_of_the_node_gets_what_the_supervisor_knows():
    made = record()
    made.report = NodeReport(full_name="/a", state="stopped", warnings=("own",))
    made.state, made.restarts = "stopped", 2
    report = made.final_report()
    assert (report.state, report.restarts, report.warnings) == ("stopped", 2, ("own",))


def test_the_priority_of_control_loops_is_a_note_of_the_table():
    records = [NodeRecord(node(name)) for name in ("left", "right", "camera")]
    for made, text in zip(records, ("normal", "normal", ""), strict=True):
        made.say("priority", text)
    note = "priority of /left, /right: normal; a busy machine delays them: run `joshua doctor`"
    assert priority_notes(records) == [note]
    records[0].say("priority", "SCHED_RR 1, memory locked")
    assert priority_notes(records)[0] == "priority of /left: SCHED_RR 1, memory locked"


STACKS = """\
Fatal Python error: something before
Thread 0x00007f (most recent call first):
  File "/lib/threading.py", line 1 in run

Current thread 0x00007e (most recent call first):
  File "/robot/arm.py", line 42 in read_bus
  File "/robot/arm.py", line 7 in tick"""


def test_the_innermost_frame_of_the_current_thread_is_found():
    dump = StackDump()
    taken = [dump.take(line) for line in STACKS.splitlines()]
    assert taken == [False, True, True, True, True, True, True]
    assert dump.place == "read_bus (/robot/arm.py:42)"
    assert not dump.take("an ordinary line")


def test_a_log_entry_as_json():
    entry = LogEntry(1_700_000_000_123_456_789, "/a", 30, "ä\n", "node.a", "log", "/x.py", 3)
    assert json.loads(entry.as_json()) == {
        "time": "2023-11-14T22:13:20.123456Z",
        "level": "WARNING",
        "node": "/a",
        "text": "ä\n",
        "stream": "log",
        "logger": "node.a",
        "place": "/x.py:3",
    }
    assert "\n" not in entry.as_json()
