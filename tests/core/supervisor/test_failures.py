"""Nodes that crash, hang, refuse to stop, or talk too much; each in a real child process.

Why one file: one case each of the failures of a node.
"""

from __future__ import annotations

import os
import re
import sys
import venv

import pytest
from joshua.plan import TopicSpec
from joshua.supervisor import managed_process, supervisor
from joshua.supervisor.policies import LadderTimes
from joshua.supervisor.tables import report_lines

SHORT_LADDER = LadderTimes(request_s=0.3, terminate_s=0.3)


def topic(name, rate_hz=0.0):
    return TopicSpec(name=name, type_name="std_msgs/msg/String", rate_hz=rate_hz)


def test_a_missing_device_at_the_start_is_exit_4_with_its_message_and_nothing_moves(robot):
    report = robot.run(robot.node("Quiet"), robot.node("NoDevice"))

    assert report.exit_code == 4
    assert "/dev/ttyACM7 does not answer" in report.reason
    assert "quiet activate" not in robot.noted()
    assert "Traceback" not in "\n".join(e.text for e in robot.ui.entries if e.level >= 20)
    assert robot.ui.tables == []
    assert [node.state for node in report.nodes] == ["stopped", "failed"]


def test_a_wrong_file_at_the_start_is_exit_2_even_beside_a_missing_device(robot, monkeypatch):
    monkeypatch.setattr(supervisor, "START_SETTLE_S", 60.0)  # a busy machine starts them one after the other
    report = robot.run(robot.node("NoDevice"), robot.node("WrongFile", restart="on-failure"))

    assert report.exit_code == 2
    assert "/wrongfile: model_path names arm.xml, which does not exist" in report.reason
    assert "/dev/ttyACM7 does not answer" in report.reason


@pytest.mark.parametrize(
    ("behaviour", "text", "at_the_end"),
    [("NoDevice", "does not answer", 0), ("Unplugged", "is disconnected", 1)],
)
def test_a_missing_device_has_one_line_and_a_lost_one_another_at_the_end(robot, behaviour, text, at_the_end):
    report = robot.run(robot.node(behaviour, restart="stop-run"), robot.node("Quiet"), duration_s=60.0)

    assert text in report.reason
    assert sum(text in entry.text for entry in robot.ui.entries if entry.level >= 20) == 1, robot.ui.text()
    assert "\n".join(report_lines(report)).count(text) == at_the_end


def test_every_missing_device_is_named_in_one_run(robot, monkeypatch):
    monkeypatch.setattr(supervisor, "START_SETTLE_S", 60.0)  # a busy machine starts them one after the other
    report = robot.run(robot.node("NoDevice", "one"), robot.node("NoDevice", "two"))

    assert report.exit_code == 4
    assert report.reason.startswith("the start failed: /one, /two: the arm on ")


def test_a_missing_module_at_the_start_is_exit_3_with_the_command_that_installs_it(robot):
    report = robot.run(robot.node("MissingModule", plugin="joshua-camera"))

    assert report.exit_code == 3
    assert "module_that_nobody_has" in report.reason
    assert "run --with camera" in report.reason


@pytest.mark.parametrize(
    ("module", "behaviour", "words"),
    [
        ("no_such_module", "Thing", "named 'no_such_module'; install the plugin: pip install acme-x"),
        ("runtime_behaviours", "NoSuchClass", "runtime_behaviours has no NoSuchClass; reinstall the plugin"),
        ("json", "JSONDecoder", "json:JSONDecoder does not derive from joshua.node.behaviour:NodeBehaviour"),
    ],
)
def test_a_behaviour_that_cannot_be_loaded_is_exit_3(robot, module, behaviour, words):
    report = robot.run(robot.node(behaviour, module=module, plugin="acme-x"))

    assert report.exit_code == 3
    assert words in report.reason


@pytest.mark.parametrize("step", ["configure", "activate"])
def test_an_exception_at_the_start_ends_the_run_and_still_shuts_the_node_down(robot, step):
    report = robot.run(robot.node("FailsIn", settings={"fails_in": step}))

    assert report.exit_code == 1
    assert f"RuntimeError: broken in {step}" in report.reason
    assert f"failed in step {step}" in robot.ui.text("/failsin")
    assert "Traceback" in robot.ui.text("/failsin")
    assert robot.noted()[-2:] == ["failsin deactivate", "failsin cleanup"]


@pytest.mark.parametrize("step", ["deactivate", "cleanup"])
def test_an_exception_at_the_end_is_reported_and_the_rest_still_runs(robot, step):
    report = robot.run(robot.node("FailsIn", settings={"fails_in": step}), robot.node("Quiet"))

    assert report.exit_code == 1
    assert [node.state for node in report.nodes] == ["failed", "stopped"]
    assert f"broken in {step}" in report.nodes[0].reason
    assert "failsin cleanup" in robot.noted()


def test_a_driver_that_calls_sys_exit_is_still_shut_down(robot):
    report = robot.run(robot.node("ExitsItself"))

    assert report.exit_code == 1
    assert "SystemExit" in report.reason
    assert robot.noted()[-2:] == ["exitsitself deactivate", "exitsitself cleanup"]


@pytest.mark.parametrize(
    ("behaviour", "words"),
    [
        ("Raises", "RuntimeError: the timer is broken"),
        ("Segfaults", "SIGSEGV"),
        ("KillsItself", "SIGKILL"),
    ],
)
def test_a_node_that_crashes_is_restarted_and_the_others_go_on(robot, behaviour, words):
    report = robot.run_until(
        lambda: "ready again" in robot.ui.text(),
        robot.node(behaviour, settings={"once": True}),
        robot.node("Ticking"),
    )

    assert report.exit_code == 0, robot.ui.text()
    crashed, other = report.nodes
    assert (crashed.state, crashed.restarts) == ("stopped", 1)
    assert (other.state, other.restarts) == ("stopped", 0)
    assert robot.ui.kinds(f"/{behaviour.lower()}") == [
        *("started", "ready", "failed", "restarting"),
        *("restarted", "ready", "stopped"),
    ]
    assert words in robot.ui.text()
    if behaviour == "Segfaults":
        assert "string_at" in robot.ui.text("/segfaults")


def test_a_node_that_keeps_crashing_is_given_up_and_the_run_ends_in_error(robot):
    report = robot.run_until(
        lambda: "given-up" in robot.ui.kinds("/raises"), robot.node("Raises"), robot.node("Ticking")
    )

    assert report.exit_code == 1
    assert robot.ui.kinds("/raises")[-1] == "given-up"
    assert "it failed 3 times within" in robot.ui.text()
    assert (report.nodes[0].state, report.nodes[0].restarts) == ("failed", 2)
    assert report.nodes[1].state == "stopped"


def test_a_node_that_is_not_back_when_the_run_ends_has_failed(robot):
    report = robot.run_until(
        lambda: "comesbackslowly restarted" in robot.noted(),
        robot.node("ComesBackSlowly", settings={"once": True}),
        robot.node("Ticking"),
    )

    assert report.exit_code == 1
    assert [node.state for node in report.nodes] == ["stopped", "stopped"]
    assert "the timer is broken" in report.nodes[0].reason


def test_the_run_ends_when_no_node_is_left(robot):
    report = robot.run(robot.node("Raises", restart="never"), duration_s=None)

    assert report.exit_code == 1
    assert report.reason == "no node is left"
    assert "stays down: its restart policy is 'never'" in robot.ui.text()


def test_a_node_whose_failure_would_recur_is_not_restarted(robot):
    report = robot.run(robot.node("RaisesForGood"), robot.node("Quiet"), duration_s=3.0)
    failed, other = report.nodes
    assert (failed.state, failed.restarts) == ("failed", 0)
    assert other.state == "stopped"
    assert "stays down: a restart would fail in the same way" in robot.ui.text()


def test_a_node_can_take_the_run_with_it(robot):
    report = robot.run(
        robot.node("Raises", restart="stop-run"), robot.node("Quiet", restart="never"), duration_s=None
    )

    assert report.exit_code == 1
    assert "its restart policy stops the run" in report.reason
    assert report.nodes[1].state == "stopped"


def test_a_callback_of_a_subscription_that_raises_fails_its_node(robot):
    report = robot.run(
        robot.node("Talker", publishers=(topic("/chat", 50.0),)),
        robot.node("BadCallback", subscriptions=(topic("/chat"),), restart="stop-run"),
        duration_s=None,
    )

    assert report.exit_code == 1
    assert "the callback is broken" in report.reason


def test_a_reader_thread_that_raises_fails_its_node(robot):
    report = robot.run(
        robot.node("Reader", settings={"reader": "fails"}, restart="stop-run"), duration_s=None
    )

    assert report.exit_code in (1, 4)  # it may fail before the run has begun or after that
    assert "/dev/video9 is gone" in report.reason


def test_a_process_group_fails_as_a_whole_and_comes_back_as_a_whole(robot):
    report = robot.run_until(
        lambda: "ready again" in robot.ui.text(),
        robot.node("Raises", process_group="sim", settings={"once": True}),
        robot.node("Quiet", process_group="sim"),
    )

    assert report.exit_code == 0, robot.ui.text()
    assert [node.restarts for node in report.nodes] == [1, 1]
    assert robot.noted().count("quiet deactivate") == 2


@pytest.mark.parametrize("behaviour", ["Sleeps", "Spins"])
def test_a_node_that_hangs_is_named_with_the_place_and_brought_into_its_safe_state(
    robot, behaviour, monkeypatch
):
    # A busy machine gets time for the stacks and for the safe state, which an arm would not get.
    monkeypatch.setattr(managed_process, "DUMP_TIMEOUT_S", 20.0)
    monkeypatch.setattr(managed_process, "HANG_TIMES", LadderTimes(10.0, 10.0))
    report = robot.run_until(
        lambda: "ready again" in robot.ui.text(),
        robot.node(behaviour, settings={"once": True}, facts={"hang_after_s": 1.0}),
        robot.node("Quiet"),
    )

    name = f"/{behaviour.lower()}"
    failed = next(event for event in robot.ui.events if event.kind == "failed")
    assert "it hung: its loop has not run for" in failed.text
    assert "in act (" in failed.text
    assert "runtime_behaviours.py" in failed.text
    assert f"{behaviour.lower()} deactivate" in robot.noted()
    shown = [entry.text for entry in robot.ui.entries if entry.node == name and entry.level >= 40]
    assert [text.split(" (")[0] for text in shown if text.startswith("it hangs in")] == ["it hangs in act"]
    assert any(text.startswith("it hangs: its loop") for text in shown)
    assert not any("stop request" in text for text in shown)  # nobody asked it to stop
    assert report.nodes[0].restarts == 1
    assert report.nodes[1].restarts == 0


def test_a_node_that_hangs_in_native_code_is_killed(robot):
    node = robot.node("HoldsInterpreter", restart="stop-run", facts={"hang_after_s": 1.0})
    report = robot.run(node, duration_s=None)

    assert report.exit_code == 1
    assert "it hung" in report.reason
    assert "SIGKILL after" in robot.ui.text("/holdsinterpreter")


def test_a_reader_thread_that_hangs_is_named(robot):
    report = robot.run(
        robot.node("Reader", settings={"reader": "hangs"}, restart="stop-run"), duration_s=None
    )

    assert report.exit_code == 1
    assert "its thread 'reader' has not run" in report.reason


def test_a_node_that_does_not_get_ready_is_named_with_what_it_waits_for(robot):
    slow = robot.node("SlowStart", facts={"ready_timeout_s": 5.0})
    report = robot.run(slow, robot.node("Quiet"), duration_s=None, start_timeout_s=None)

    assert report.exit_code == 1
    assert (
        "/slowstart: not ready after 5 s: it is still in its configure step, "
        "waiting for an answer of motor 3. Allow a longer start with --start-timeout SECONDS" in report.reason
    )


def test_a_longer_start_is_longer_for_each_node(robot):
    slow = robot.node("SlowStart", facts={"ready_timeout_s": 1.0})
    report = robot.run(slow, robot.node("Quiet"), duration_s=None, start_timeout_s=3.0)

    assert report.exit_code == 1
    assert "/slowstart: not ready after 3 s: " in report.reason


def test_a_node_that_does_not_stop_climbs_the_ladder_and_is_killed(robot):
    report = robot.run(
        robot.node("IgnoresStop", facts={"stop_timeout_s": 2.0}),
        robot.node("Quiet", facts={"stop_timeout_s": 60.0}),
        ladder=SHORT_LADDER,
    )

    assert report.exit_code == 1
    assert report.nodes[0].state == "killed"
    assert report.nodes[1].state == "stopped"
    text = robot.ui.text("/ignoresstop")
    assert re.search(r"SIGTERM after \d+\.\d s: .* in its deactivate step", text)
    assert re.search(r"SIGKILL after \d+\.\d s: ", text)


def test_a_node_that_blocks_is_interrupted_and_still_comes_to_its_safe_state(robot):
    report = robot.run_until(
        lambda: "sleeps acts" in robot.noted(),
        robot.node("Sleeps", facts={"hang_after_s": 60.0}),
        ladder=LadderTimes(0.3, 30.0),
    )

    assert report.exit_code == 1
    assert "did not notice the stop request" in report.nodes[0].reason
    assert robot.noted()[-2:] == ["sleeps deactivate", "sleeps cleanup"]


def test_a_node_that_swallows_the_interruption_is_killed(robot):
    report = robot.run_until(
        lambda: "ignoreseverything acts" in robot.noted(),
        robot.node("IgnoresEverything", facts={"hang_after_s": 60.0}),
        ladder=SHORT_LADDER,
    )

    assert report.exit_code == 1
    assert report.nodes[0].state == "killed"


def test_a_flood_of_log_lines_is_cut_with_a_count_and_delays_nobody(robot):
    cut = ("log lines dropped", "lines of its output dropped")
    report = robot.run_until(
        lambda: "floods acted" in robot.noted() and all(text in robot.ui.text("/floods") for text in cut),
        robot.node("Floods"),
        robot.node("Ticking"),
    )

    assert report.exit_code == 0, robot.ui.text()[-2000:]
    text = robot.ui.text("/floods")
    assert "flood 0" in text
    assert "log lines dropped" in text
    assert "lines of its output dropped" in text
    assert len(text.splitlines()) < 2000


def test_odd_output_is_cut_and_made_printable(robot):
    report = robot.run_until(lambda: "writesoddly acted" in robot.noted(), robot.node("WritesOddly"))

    assert report.exit_code == 0, robot.ui.text()[-2000:]
    lines = [entry.text for entry in robot.ui.entries if entry.node == "/writesoddly"]
    assert any(line.startswith("huge xxx") and "more characters" in line for line in lines)
    assert any(line.startswith("yyy") and line.endswith("more bytes)") for line in lines)
    assert any("not utf-8: \\xff\\xfe" in line for line in lines)
    assert any("surrogate \\udc80" in line for line in lines)
    assert any("cannot be formatted" in line for line in lines)
    assert "unfinished" in lines
    assert max(len(line) for line in lines) < 9000


def test_a_node_runs_with_the_interpreter_of_another_environment(robot, tmp_path, monkeypatch):
    environment = tmp_path / "environment"
    venv.create(environment, with_pip=False, symlinks=True)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(entry for entry in sys.path if entry))
    interpreter = str(environment / "bin" / "python")

    report = robot.run_until(
        lambda: "ticking ticks" in robot.noted(),
        robot.node("Ticking", interpreter=interpreter),
        robot.node("Quiet"),
    )

    assert report.exit_code == 0, robot.ui.text()
    assert report.nodes[0].timers[0].ticks > 0


def test_an_environment_without_the_core_is_exit_3_with_the_command_that_installs_it(
    robot, tmp_path, monkeypatch
):
    environment = tmp_path / "environment"
    venv.create(environment, with_pip=False, symlinks=True)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    interpreter = str(environment / "bin" / "python")

    report = robot.run(robot.node("Quiet", interpreter=interpreter))

    assert report.exit_code == 3
    assert re.search(rf"{re.escape(interpreter)} -m pip install -e \S*joshua-core", report.reason)


def test_a_missing_interpreter_is_named(robot):
    report = robot.run(robot.node("Quiet", interpreter="/nowhere/bin/python"))

    assert report.exit_code == 3
    assert "/nowhere/bin/python is missing or cannot be run. Correct Node.python" in report.reason


def test_another_protocol_version_in_an_environment_is_named(robot, monkeypatch):
    monkeypatch.setattr("joshua.supervisor.managed_process.ipc.PROTOCOL_VERSION", 99)

    report = robot.run(robot.node("Quiet"))

    assert report.exit_code == 3
    assert "uses another protocol" in report.reason


def test_a_port_that_no_router_can_use_is_an_error_that_says_what_to_do(robot):
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        robot.transport = robot.transport.model_copy(update={"listen_endpoints": (f"tcp/localhost:{port}",)})
        report = robot.run(robot.node("Quiet"))

    assert report.exit_code == 1
    assert str(port) in report.reason
    assert "listen_endpoints" in report.reason
