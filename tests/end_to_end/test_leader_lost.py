"""A leader that starts anew or stays away: what its follower does, read at the follower's servos."""

from __future__ import annotations

import json
import math
import os
import signal
from itertools import pairwise
from pathlib import Path

import pytest
from guarded_arm import Rig, running
from joshua.devices.goal import RAMP_SPEED_RAD_S
from joshua_emulator import EmulatedBus
from joshua_sts3215.registers import GOAL_POSITION
from processes import descendants_of, title_of

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes in /proc")

POSE = dict.fromkeys(range(1, 7), 2450.0)
RAMP_TICKS_S = RAMP_SPEED_RAD_S * 4096 / math.tau


def goals(arm: EmulatedBus, since: int) -> list[tuple[float, int]]:
    """What the first servo was told: times in seconds, and goals in ticks."""
    found = []
    for entry in arm.log("sync_write", since=since):
        data = bytes.fromhex(entry["parameters"])
        if data[:3] == bytes((GOAL_POSITION.address, 2, 1)):
            found.append((entry["t_ns"] / 1e9, int.from_bytes(data[3:5], "little")))
    return found


def present(arm: EmulatedBus) -> list[int]:
    return [servo["present_position"] for servo in arm.servos()]


def leader_of(rig: Rig) -> int:
    (number,) = [n for n in descendants_of(rig.process.pid) if title_of(n) == "leader_arm"]
    return number


@pytest.mark.timing
def test_the_follower_holds_then_ramps_or_acts_by_its_policy(tmp_path: Path, joshua_domain_id: int) -> None:
    policy = ("robot.actions[1].on_stale=RELEASE", "robot.actions[1].on_stale_after_s=9")
    with running(tmp_path, joshua_domain_id, policy) as rig:
        rig.leader.hand(dict.fromkeys(range(1, 7), 2100.0), duration_s=0.2)
        rig.wait(lambda: all(abs(ticks - 2100) < 4 for ticks in present(rig.follower)))
        since = rig.follower.log()[-1]["sequence"]
        os.kill(leader_of(rig), signal.SIGKILL)
        rig.leader.hand(POSE)
        rig.wait(lambda: all(abs(ticks - 2450) < 4 for ticks in present(rig.follower)))
        assert rig.energised() == {True}
        told = goals(rig.follower, since)
        moves = [item for item in told if 2110 < item[1] < 2440]
        assert max(abs(b[1] - a[1]) for a, b in pairwise(told)) < 45, "no jump"
        speed = (moves[-1][1] - moves[0][1]) / (moves[-1][0] - moves[0][0])
        assert speed < RAMP_TICKS_S * 1.1, "it approaches the leader slowly again"

        rig.leader.fault("unplug")
        rig.wait(lambda: rig.energised() == {False})
        assert all(abs(ticks - 2450) < 40 for ticks in present(rig.follower))
        (run,) = json.loads(rig.joshua("status", "--format", "json").stdout)
        (node,) = [item for item in run["nodes"] if item["full_name"] == "/follower_arm"]
        assert node["state"] == "fault"
        assert "commands did not resume within 9 s: torque was switched off" in node["reason"]
        assert rig.joshua("resume", "follower_arm").returncode == 0
        assert rig.energised() == {True}
        output = rig.stop()
    assert "commands stopped: the joints hold their position" in output
    assert "commands resumed: the joints approach them slowly" in output
