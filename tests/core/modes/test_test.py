"""The pass/fail table of MODE_TEST."""

from collections.abc import Sequence

from joshua.cli.motion_report import verdict_lines
from joshua.modes.test import passed, verdict
from joshua.plan import CheckResult, NodeKind, NodeReport, NodeSpec, Plan, RunReport
from joshua.supervisor.tables import PLAIN, Screen


def plan_of(*names: str) -> Plan:
    nodes = tuple(
        NodeSpec(name=name, kind=NodeKind.SENSOR, behaviour="a:B", implementation="a:C") for name in names
    )
    return Plan(source="x.pbtxt", mode="MODE_TEST", nodes=nodes)


def verdict_text(rows: Sequence[tuple[str, CheckResult]], report: RunReport, screen: Screen = PLAIN) -> str:
    return "\n".join(verdict_lines(rows, report, screen)) + "\n"


def report_of(*nodes: NodeReport) -> RunReport:
    return RunReport(exit_code=0, nodes=nodes)


def test_a_node_that_ran_to_the_end_passes_with_its_own_checks():
    node = NodeReport(
        full_name="/camera",
        state="stopped",
        checks=(CheckResult(check="rate", passed=True, measured="30 Hz"),),
    )
    rows = verdict(plan_of("camera"), report_of(node))
    assert [(name, check.check, check.passed) for name, check in rows] == [
        ("/camera", "runs to the end", True),
        ("/camera", "rate", True),
    ]
    assert passed(rows)
    assert verdict_text(rows, report_of()).splitlines()[-1] == "test passed: 2 checks"


def test_a_failed_node_fails_the_test_with_its_reason():
    node = NodeReport(full_name="/camera", state="failed", reason="the cable is unplugged")
    rows = verdict(plan_of("camera"), report_of(node))
    assert not passed(rows)
    text = verdict_text(rows, report_of())
    assert text.startswith("FAIL  /camera  runs to the end  the cable is unplugged\n")
    assert text.endswith("test failed: 1 of 1 checks\n")


def test_a_node_that_restarted_fails():
    killed = "its guardian killed it: no heartbeat for 0.2 s"
    node = NodeReport(full_name="/camera", state="stopped", restarts=2, last_failure=killed)
    rows = verdict(plan_of("camera"), report_of(node))
    assert not passed(rows)
    text = f"FAIL  /camera  runs to the end  restarted 2 times: {killed}"
    assert verdict_text(rows, report_of()).startswith(f"{text}\n")
    fault = node.model_copy(update={"reason": "fault: look at the arm"})
    rows = verdict(plan_of("camera"), report_of(fault))
    assert verdict_text(rows, report_of()).startswith(f"{text}; fault: look at the arm\n")


def test_a_node_without_a_report_fails():
    rows = verdict(plan_of("camera", "lidar"), report_of(NodeReport(full_name="/camera", state="stopped")))
    assert [(name, check.passed) for name, check in rows] == [("/camera", True), ("/lidar", False)]


def test_a_test_without_checks_has_not_passed():
    assert not passed([])
    assert verdict_text([], report_of()) == "\ntest failed: no checks\n".lstrip()


def test_a_test_that_was_stopped_early_has_not_passed():
    good = CheckResult(check="rate", passed=True, measured="30 Hz")
    node = NodeReport(full_name="/camera", state="stopped", checks=(good,))
    report = RunReport(exit_code=0, nodes=(node,), reason="stopped by SIGINT", interrupted=True)
    rows = verdict(plan_of("camera"), report)
    assert not passed(rows)
    assert verdict_text(rows, report).splitlines() == [
        "----  /camera  runs to the end  stopped by SIGINT",
        "PASS  /camera  rate             30 Hz",
        "test not finished: stopped by SIGINT before its time was over",
    ]


def test_what_failed_by_itself_before_an_early_stop_is_said_to_have_failed():
    node = NodeReport(full_name="/camera", state="failed", reason="the cable is unplugged")
    report = RunReport(exit_code=1, nodes=(node,), reason="stopped by SIGINT", interrupted=True)
    text = verdict_text(verdict(plan_of("camera"), report), report)
    assert text.startswith("FAIL  /camera  runs to the end  the cable is unplugged\n")


def test_a_narrow_terminal_gets_a_line_for_each_node_and_wrapped_values_in_colour():
    checks = (
        CheckResult(check="lag", passed=False, measured="61 ms behind the goal"),
        CheckResult(check="load", passed=True, measured="0.175 at most"),
    )
    node = NodeReport(full_name="/camera", state="stopped", checks=checks)
    rows = verdict(plan_of("camera"), report_of(node))
    assert verdict_text(rows, report_of(node), Screen(40)).splitlines() == [
        "/camera",
        "  PASS  runs to the end  stopped",
        "  FAIL  lag              61 ms behind",
        "                         the goal",
        "  PASS  load             0.175 at most",
        "test failed: 1 of 3 checks",
    ]
    colours = verdict_text(rows, report_of(node), Screen(0, colour=True)).splitlines()
    assert colours[0] == "\x1b[32mPASS\x1b[0m  /camera  runs to the end  stopped"
    assert colours[1].startswith("\x1b[31mFAIL\x1b[0m  /camera  lag ")
    assert colours[-1] == "\x1b[31mtest failed: 1 of 3 checks\x1b[0m"
