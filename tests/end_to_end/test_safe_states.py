"""Every end of a driver with every safe state: what the servos do, measured at the emulator."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from guarded_arm import HOLD, RELEASE, Rig, park, running

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes in /proc")

#: Away from where the leader has the arm, so that a park is a motion.
PARK_RAD = 0.3
PARK_TICKS = round(PARK_RAD / 6.28319 * 4096)


def stop_normally(rig: Rig) -> None:
    rig.process.send_signal(signal.SIGINT)


def kill_driver(rig: Rig) -> None:
    os.kill(rig.driver, signal.SIGKILL)


def kill_supervisor(rig: Rig) -> None:
    rig.process.kill()


def hang_driver(rig: Rig) -> None:
    os.kill(rig.driver, signal.SIGSTOP)


def hang_everything(rig: Rig) -> None:
    """Nobody but the guardian notices."""
    os.kill(rig.process.pid, signal.SIGSTOP)
    os.kill(rig.driver, signal.SIGSTOP)


def lose_the_guardian(rig: Rig) -> None:
    """The driver raises, because nothing would stop it in an emergency."""
    os.kill(rig.guardian, signal.SIGKILL)


ENDS = [stop_normally, kill_driver, kill_supervisor, hang_driver, hang_everything, lose_the_guardian]
STATES = {"hold": HOLD, "release": RELEASE, "park": park(PARK_RAD)}


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("end", ENDS, ids=lambda end: end.__name__)
def test_the_safe_state_stands(
    tmp_path: Path, joshua_domain_id: int, end: Callable[[Rig], None], state: str
) -> None:
    with running(tmp_path, joshua_domain_id, STATES[state]) as rig:
        sequence = rig.follower.log()[-1]["sequence"]
        end(rig)
        rig.wait(lambda: rig.gone(rig.guardian) and rig.gone(rig.driver))
        released = [entry for entry in rig.follower.log("torque", since=sequence) if not entry["on"]]
        if state == "hold":
            assert rig.energised() == {True}
            assert not released, "not even for a moment"
            return
        assert rig.energised() == {False}
        assert {entry["id"] for entry in released} == {1, 2, 3, 4, 5, 6}
        places = [servo["present_position"] - 2048 for servo in rig.follower.servos()]
        if state == "release" or end is lose_the_guardian:
            assert all(abs(place) < PARK_TICKS - 60 for place in places), "it did not move"
        else:
            assert all(abs(place - PARK_TICKS) < 60 for place in places), "it was parked first"
