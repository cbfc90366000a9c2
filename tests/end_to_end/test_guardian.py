"""Safe states of an emulated follower, whatever ends its driver: real processes, state read at the servos."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from pathlib import Path

import pytest
from guarded_arm import HOLD, RELEASE, Rig, park, running
from processes import children_of, descendants_of, is_guardian, title_of

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes in /proc")


def test_only_the_actuator_with_torque_has_a_guardian(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, ()) as rig:
        assert [number for number in children_of(rig.driver) if is_guardian(number)] == [rig.guardian]
        assert os.getsid(rig.guardian) == rig.guardian
        output = rig.stop()
        assert rig.process.returncode == 0, output
        assert rig.gone(rig.guardian)
        assert rig.energised() == {True}  # HOLD is the default


def test_a_normal_stop_releases(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, RELEASE) as rig:
        output = rig.stop()
        assert rig.process.returncode == 0, output
        assert rig.energised() == {False}
        assert rig.gone(rig.guardian)


def test_a_normal_stop_parks_then_releases(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, park(0.1)) as rig:
        output = rig.stop()
        assert rig.process.returncode == 0, output
        assert rig.energised() == {False}
        assert all(abs(servo["present_position"] - 2048) in range(25, 106) for servo in rig.follower.servos())


def test_a_killed_driver_is_replaced_by_its_guardian(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, RELEASE) as rig:
        os.kill(rig.driver, signal.SIGKILL)
        rig.wait(lambda: rig.energised() == {False})
        rig.wait(lambda: rig.gone(rig.guardian) and rig.logged("ended without a safe stop"))
        output = rig.stop()
        assert "guardian: the driver ended without a safe stop; 1 released" in output
        assert rig.energised() == {False}


def test_a_killed_driver_leaves_a_held_arm_held(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        os.kill(rig.driver, signal.SIGKILL)
        rig.wait(lambda: rig.gone(rig.guardian) and rig.logged("ended without a safe stop"))
        assert rig.energised() == {True}
        output = rig.stop()
        assert "guardian: the driver ended without a safe stop; 1 held" in output


def test_a_killed_driver_leaves_the_object_in_the_gripper(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        rig.follower.ask("set", id=6, object_ticks=rig.follower.servo(6)["present_position"] - 50)
        rig.leader.hand({6: 1850.0}, duration_s=0.5)
        rig.wait(lambda: rig.follower.ask("registers", id=6)["registers"]["torque_limit"] == 200)  # it grips
        sequence = rig.follower.log()[-1]["sequence"]
        os.kill(rig.driver, signal.SIGKILL)
        rig.wait(lambda: rig.gone(rig.guardian) and rig.logged("ended without a safe stop"))
        rig.wait(lambda: rig.logged("starting again") and rig.is_ready())
        time.sleep(2.5)  # a gripper that presses on trips within 2.2 s
        assert not [entry for entry in rig.follower.log("torque", since=sequence) if not entry["on"]]
        servo = rig.follower.servo(6)
        assert 0 < servo["present_position"] - servo["goal_position"] <= 33
        assert 150 <= abs(servo["present_load"]) <= 200
        assert "guardian: the driver ended without a safe stop; 1 held" in rig.stop()


def test_a_driver_that_runs_again_stays_without_torque(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, RELEASE) as rig:
        os.kill(rig.driver, signal.SIGKILL)
        rig.wait(lambda: rig.energised() == {False})
        again: list[int] = []

        def is_back() -> bool:
            again[:] = [n for n in descendants_of(rig.process.pid) if title_of(n) == "follower_arm"]
            return bool(again)

        rig.wait(is_back)
        rig.wait(lambda: bool(rig.follower.servos()))
        output = rig.stop()
        assert rig.energised() == {False}
        assert "starting again" in output


def test_a_hung_driver_is_killed(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, RELEASE) as rig:
        os.kill(rig.driver, signal.SIGSTOP)
        rig.wait(lambda: rig.energised() == {False})
        assert rig.gone(rig.driver)
        rig.wait(lambda: rig.gone(rig.guardian) and rig.logged("the driver hung"))
        output = rig.stop()
        assert "guardian: the driver hung: no heartbeat for 0.3 s; 1 released" in output, output
        # the supervisor, which has the same limit, may find the hang first
        found = ("its guardian killed it: the driver hung: no heartbeat", "it hung: its loop has not run for")
        assert any(text in output for text in found), output


def test_a_killed_supervisor_leaves_a_safe_arm(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, RELEASE) as rig:
        rig.process.kill()
        rig.wait(lambda: rig.energised() == {False})
        rig.wait(lambda: rig.gone(rig.guardian) and rig.gone(rig.driver))


def test_a_killed_fork_server_leaves_a_safe_arm(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, RELEASE) as rig:
        os.kill(rig.fork_server, signal.SIGKILL)
        rig.wait(lambda: rig.energised() == {False})
        rig.wait(lambda: rig.gone(rig.guardian) and rig.gone(rig.driver))


def test_supervisor_and_driver_killed_at_once(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, RELEASE) as rig:
        rig.process.kill()
        os.kill(rig.driver, signal.SIGKILL)
        rig.wait(lambda: rig.energised() == {False})
        rig.wait(lambda: rig.gone(rig.guardian))


STAYS_DOWN = "robot.actions[1].node.restart=RESTART_NEVER"
BOTH_ENDED = "guardian: the driver and its guardian ended without a safe stop"


def kill_driver_and_guardian(rig: Rig) -> None:
    """Kills both. Stopped first, the guardian does not act if this machine stalls in between."""
    os.kill(rig.guardian, signal.SIGSTOP)
    os.kill(rig.driver, signal.SIGKILL)
    with contextlib.suppress(ProcessLookupError):  # the fork server kills it, too
        os.kill(rig.guardian, signal.SIGKILL)


def test_driver_and_guardian_killed_at_once(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, (*RELEASE, STAYS_DOWN)) as rig:
        kill_driver_and_guardian(rig)
        rig.wait(lambda: rig.energised() == {False})  # not by the next driver: there is none
        rig.wait(lambda: rig.logged(BOTH_ENDED))
        output = rig.stop()
        assert f"{BOTH_ENDED}; 1 released" in output
        assert "starting again" not in output


def test_driver_and_guardian_killed_at_once_leave_a_held_arm_held(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with running(tmp_path, joshua_domain_id, HOLD) as rig:
        kill_driver_and_guardian(rig)
        rig.wait(lambda: rig.logged(BOTH_ENDED))
        rig.wait(lambda: rig.logged("starting again") and rig.is_ready())
        assert rig.energised() == {True}
        assert f"{BOTH_ENDED}; 1 held" in rig.stop()


def test_a_parking_of_the_fork_server_makes_the_next_driver_wait(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with running(tmp_path, joshua_domain_id, park(0.3)) as rig:
        kill_driver_and_guardian(rig)
        rig.wait(lambda: rig.energised() == {False})
        rig.wait(lambda: rig.logged("starting again") and rig.is_ready())
        output = rig.stop()
        assert f"{BOTH_ENDED}; 1 released" in output
        assert "in use by" not in output, output


def test_only_the_fork_server_survives(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, RELEASE) as rig:
        os.kill(rig.process.pid, signal.SIGKILL)
        kill_driver_and_guardian(rig)
        rig.wait(lambda: rig.energised() == {False})
        rig.wait(lambda: rig.gone(rig.fork_server))
        assert rig.logged(BOTH_ENDED)


def test_signals_do_not_end_a_guardian(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, RELEASE) as rig:
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
            os.kill(rig.guardian, number)
        os.kill(rig.driver, signal.SIGKILL)
        rig.wait(lambda: rig.energised() == {False})


def test_a_driver_without_guardian_stops(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, RELEASE) as rig:
        os.kill(rig.guardian, signal.SIGKILL)
        rig.wait(lambda: rig.energised() == {False})
        assert "the guardian is gone" in rig.stop()


def test_an_unplugged_adapter_does_not_keep_the_guardian(tmp_path: Path, joshua_domain_id: int) -> None:
    short = (*RELEASE, "robot.actions[1].park_timeout_s=0.5")
    with running(tmp_path, joshua_domain_id, short) as rig:
        rig.follower.fault("unplug")
        rig.wait(lambda: rig.gone(rig.guardian))
        assert rig.energised() == {True}
        rig.follower.fault("replug")
        rig.wait(lambda: rig.energised() == {False})  # the next driver makes up for it
        assert "is not verified" in rig.stop()


def test_an_exception_in_the_driver_releases_what_still_answers(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    short = (*RELEASE, "robot.actions[1].park_timeout_s=0.5")
    with running(tmp_path, joshua_domain_id, short) as rig:
        rig.follower.fault("silent", 5)
        rig.wait(lambda: rig.gone(rig.guardian))
        assert {servo["energised"] for servo in rig.follower.servos() if servo["id"] != 5} == {False}
        output = rig.stop()
        assert "is not verified: ids 5 did not confirm. Cut the arm's supply by hand" in output, output
