"""Ctrl-C again while an emulated arm parks: only two further ones within 2 s of each other drop it."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import pytest
from guarded_arm import Rig, park, running
from joshua.supervisor.reactor import ECHO_S

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes in /proc")

PARK_RAD = -1.6
PARK_TICKS = 2048 + round(PARK_RAD / 6.28319 * 4096)
PATIENT = (*park(PARK_RAD), "robot.actions[1].park_timeout_s=20")

FIRST = (
    "parking /follower_arm, up to 20 s; Ctrl-C twice more within 2 s stops at once and drops /follower_arm"
)


def parking(rig: Rig) -> None:
    """Begins the park, and blocks a joint on its way, however long the rest takes."""
    middle = rig.follower.servos()[3]["present_position"]
    rig.process.send_signal(signal.SIGINT)
    rig.wait(lambda: rig.follower.servos()[3]["present_position"] < middle - 60)
    rig.follower.ask("set", id=4, blocked=True)
    rig.wait(lambda: rig.logged(FIRST))


def press(rig: Rig, number: int) -> None:
    """Sends a signal that is no echo of the one before."""
    time.sleep(2 * ECHO_S)
    rig.process.send_signal(number)


def logged_times(rig: Rig, text: str) -> int:
    (log,) = (rig.folder / "log").glob("*.jsonl")
    return log.read_text(encoding="utf-8").count(text)


def test_one_more_ctrl_c_and_a_closed_terminal_do_not_drop_an_arm(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with running(tmp_path, joshua_domain_id, PATIENT) as rig:
        parking(rig)
        press(rig, signal.SIGINT)
        rig.wait(lambda: rig.logged("Ctrl-C once more within 2 s stops at once and drops /follower_arm"))
        for _ in range(3):
            press(rig, signal.SIGHUP)
        time.sleep(2 * ECHO_S)
        assert rig.process.poll() is None
        assert rig.energised() == {True}
        rig.follower.ask("set", id=4, blocked=False)
        output = rig.process.communicate(timeout=90)[0]
        assert rig.process.returncode == 0, output
        assert abs(rig.follower.servos()[3]["present_position"] - PARK_TICKS) < 60, "it was parked"
        assert rig.energised() == {False}


def test_two_more_drop_it_at_once(tmp_path: Path, joshua_domain_id: int) -> None:
    with running(tmp_path, joshua_domain_id, PATIENT) as rig:
        parking(rig)
        assert rig.energised() == {True}
        forced = "SIGINT repeated: this stops at once and drops /follower_arm"
        answers = 0
        while not rig.logged(forced):  # a machine that stalls for more than 2 s needs another one
            press(rig, signal.SIGINT)
            answers += 1
            rig.wait(lambda: rig.logged(forced) or logged_times(rig, "Ctrl-C once more") == answers)  # noqa: B023
        rig.wait(lambda: rig.gone(rig.guardian) and rig.gone(rig.driver))
        assert rig.energised() == {False}
        assert rig.follower.servos()[3]["present_position"] > PARK_TICKS + 60, "it was on its way"
        output = rig.process.communicate(timeout=60)[0]
        assert rig.process.returncode == 1, output
        assert "/follower_arm: killed: killed by a repeated signal" in output
