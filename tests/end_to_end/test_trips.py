"""Protections of an emulated arm trip while it is driven, and ``joshua resume`` ends that."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from emulated_teleop import JOSHUA
from emulators_of_runs import bring_about
from guarded_arm import HOLD, RELEASE, Rig, park, running
from watched import watched_run

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes in /proc")

DUAL = Path(__file__).parents[2] / "configs" / "teleop_dual_arm.pbtxt"


def heat(rig: Rig) -> None:
    rig.follower.ask("set", id=1, temperature_c=75)


def cool(rig: Rig) -> None:
    rig.follower.ask("set", id=1, temperature_c=30)


def weaken(rig: Rig) -> None:
    rig.follower.ask("set", id=2, volts=3.0)


def strengthen(rig: Rig) -> None:
    rig.follower.ask("set", id=2, volts=12.0)


def node(rig: Rig, name: str = "/follower_arm") -> dict[str, Any]:
    (answer,) = json.loads(rig.joshua("status", "--format", "json").stdout)
    (found,) = [item for item in answer["nodes"] if item["full_name"] == name]
    return dict(found)


def wait_for_state(rig: Rig, state: str) -> dict[str, Any]:
    deadline_s = time.monotonic() + 60
    while (found := node(rig))["state"] != state:
        assert time.monotonic() < deadline_s, found
        time.sleep(0.05)
    return found


@pytest.mark.parametrize("state", [HOLD, RELEASE, park(0.5)], ids=["hold", "release", "park"])
def test_an_overload_takes_the_torque_off_whatever_the_safe_state_is(
    tmp_path: Path, joshua_domain_id: int, state: tuple[str, ...]
) -> None:
    with running(tmp_path, joshua_domain_id, state) as rig:
        rig.follower.fault("overload", 3)
        rig.wait(lambda: rig.energised() == {False})
        tripped = wait_for_state(rig, "fault")
        assert "elbow_flex: the servo reports: overloaded" in tripped["reason"]
        assert "Run `joshua resume follower_arm` to re-enable torque" in tripped["reason"]
        assert (tripped["restarts"], tripped["process_id"]) == (0, rig.driver), "the node goes on"
        assert node(rig, "/leader_arm")["state"] == "ready"
        rig.wait(lambda: rig.gone(rig.guardian))
        result = rig.joshua("resume", "follower_arm")
        assert result.returncode == 0, result.stderr
        assert rig.energised() == {True}
        assert wait_for_state(rig, "ready")["reason"] == ""
        rig.stop()
        assert rig.process.returncode == 0, "a fault that was ended is no failure"


def test_an_overload_of_the_gripper_relaxes_it_and_the_arm_stands(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        rig.follower.fault("overload", 6)
        rig.wait(lambda: not rig.follower.servo(6)["energised"])
        tripped = wait_for_state(rig, "fault")
        assert "gripper: the servo reports: overloaded" in tripped["reason"]
        assert "Only this joint lost its torque" in tripped["reason"]
        assert "joshua resume follower_arm" in tripped["reason"]
        assert [servo["energised"] for servo in rig.follower.servos()] == [True] * 5 + [False]
        written = len(rig.follower.log("sync_write"))
        rig.wait(lambda: len(rig.follower.log("sync_write")) > written + 20)
        assert not rig.follower.servo(6)["energised"], "a goal written to it would enable its torque"
        result = rig.joshua("resume", "follower_arm")
        assert result.returncode == 0, result.stderr
        assert rig.energised() == {True}
        assert wait_for_state(rig, "ready")["reason"] == ""
        rig.stop()
        assert rig.process.returncode == 0


@pytest.mark.parametrize(
    ("begin", "end", "reason"),
    [(heat, cool, "shoulder_pan: "), (weaken, strengthen, " V, allowed ")],
    ids=["heat", "supply"],
)
def test_resume_is_refused_until_the_cause_is_gone(
    tmp_path: Path,
    joshua_domain_id: int,
    begin: Callable[[Rig], None],
    end: Callable[[Rig], None],
    reason: str,
) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        begin(rig)
        rig.wait(lambda: rig.energised() == {False})
        assert reason in wait_for_state(rig, "fault")["reason"]
        refused = rig.joshua("resume", "follower_arm")
        if refused.returncode == 0:  # the supply must be wrong for three samples: it trips again
            rig.wait(lambda: rig.energised() == {False})
            wait_for_state(rig, "fault")
        else:
            assert refused.returncode == 4
            assert "the fault is still there" in refused.stderr
            assert reason in refused.stderr
        assert rig.energised() == {False}
        assert node(rig)["state"] == "fault"
        end(rig)
        resumed = rig.joshua("resume", "follower_arm")
        assert resumed.returncode == 0, resumed.stderr
        assert rig.energised() == {True}


def test_resume_is_refused_while_the_motor_check_fails(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        rig.follower.fault("overload", 3)
        wait_for_state(rig, "fault")
        rig.follower.ask("set_register", id=2, name="mode", value=1)
        refused = rig.joshua("resume", "follower_arm")
        assert refused.returncode == 4
        assert "the check of the device failed" in refused.stderr
        assert "id 2 is in mode 1, expected 0 (position)" in refused.stderr
        assert rig.energised() == {False}
        rig.follower.ask("set_register", id=2, name="mode", value=0)
        assert rig.joshua("resume", "follower_arm").returncode == 0


def test_a_held_arm_is_resumed_without_falling(tmp_path: Path, joshua_domain_id: int) -> None:
    """Its driver was killed, its guardian holds it, its next driver takes it over."""
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        sequence = rig.follower.log()[-1]["sequence"]
        os.kill(rig.driver, signal.SIGKILL)
        rig.wait(lambda: rig.gone(rig.guardian))
        found = wait_for_state(rig, "fault")
        assert "restarted after a failure, holding its position. Check the arm" in found["reason"]
        assert rig.energised() == {True}
        result = rig.joshua("resume", "follower_arm")
        assert result.returncode == 0, result.stderr
        assert wait_for_state(rig, "ready")["restarts"] == 1
        assert not [entry for entry in rig.follower.log("torque", since=sequence) if not entry["on"]]


def test_a_run_that_ends_in_fault_has_failed(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        heat(rig)
        rig.wait(lambda: rig.energised() == {False})
        wait_for_state(rig, "fault")
        output = rig.stop()
        assert rig.process.returncode == 1, output
        assert rig.energised() == {False}


def test_a_power_cut_leaves_no_joint_with_torque(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        rig.follower.fault("brown_out", 4)
        rig.wait(lambda: rig.energised() == {False})
        wait_for_state(rig, "fault")
        result = rig.joshua("resume", "follower_arm")
        assert result.returncode == 0, result.stderr
        assert rig.energised() == {True}


def test_the_other_arms_go_on(tmp_path: Path, joshua_domain_id: int) -> None:
    (tmp_path / "run").mkdir(mode=0o700)
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(joshua_domain_id),
        "XDG_RUNTIME_DIR": str(tmp_path / "run"),
        "XDG_STATE_HOME": str(tmp_path / "state"),
    }

    def joshua(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [str(JOSHUA), *arguments]
        return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)

    def states() -> dict[str, dict[str, Any]]:
        answers = json.loads(joshua("status", "--format", "json").stdout)
        return {item["full_name"]: item for answer in answers for item in answer["nodes"]}

    with watched_run([str(JOSHUA), "--config", str(DUAL), "--emulate"], environment) as watched:
        watched.wait("nodes ready")
        bring_about(watched.text, "left_follower", "overload", 2)
        deadline_s = time.monotonic() + 60
        while states().get("/left_follower", {}).get("state") != "fault":
            assert watched.process.poll() is None, watched.text
            assert time.monotonic() < deadline_s, states()
            time.sleep(0.1)
        time.sleep(1.0)
        now = states()
        assert {name: item["state"] for name, item in now.items()} == {
            "/left_leader": "ready",
            "/left_follower": "fault",
            "/right_leader": "ready",
            "/right_follower": "ready",
        }
        assert now["/right_follower"]["published_hz"]["/right_follower/applied_command"] > 10
        assert now["/left_follower"]["published_hz"]["/left/follower/joint_states"] > 10
        assert joshua("resume", "left_follower").returncode == 0
        assert states()["/left_follower"]["state"] == "ready"
        watched.process.send_signal(signal.SIGINT)
        code, output = watched.end()
    assert code == 0, output
