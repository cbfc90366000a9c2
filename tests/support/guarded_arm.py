"""A running teleoperation of emulated arms whose follower has torque, and the processes behind it."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from emulated_teleop import teleoperation
from joshua.tools import CallError, RunningSystem
from joshua_emulator import EmulatedBus
from processes import descendants_of, is_guardian, parent_of, title_of

RELEASE = ("robot.actions[1].safe_state=RELEASE",)
HOLD = ("robot.actions[1].safe_state=HOLD",)


def park(angle_rad: float) -> tuple[str, ...]:
    """Parks every joint at one angle."""
    pose = ", ".join([str(angle_rad)] * 6)
    return ("robot.actions[1].safe_state=PARK_THEN_RELEASE", f"robot.actions[1].park_pose_rad=[{pose}]")


@dataclass
class Rig:
    """A running teleoperation whose follower has torque."""

    process: subprocess.Popen[str]
    folder: Path
    environment: dict[str, str]
    leader: EmulatedBus
    follower: EmulatedBus
    driver: int
    guardian: int
    fork_server: int

    def wait(self, condition: Callable[[], bool], timeout_s: float = 60.0) -> None:
        """Waits until a condition comes true."""
        deadline_s = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline_s, [servo["energised"] for servo in self.follower.servos()]
            time.sleep(0.02)

    def energised(self) -> set[bool]:
        """Whether the servos of the follower have torque: {True}, {False} or both."""
        return {servo["energised"] for servo in self.follower.servos()}

    def logged(self, text: str) -> bool:
        """Whether the log of the run holds a text; a guardian's report comes after its process has ended."""
        return any(text in path.read_text(encoding="utf-8") for path in (self.folder / "log").glob("*.jsonl"))

    def is_ready(self) -> bool:
        """Whether every node of the run is ready."""
        with contextlib.suppress(CallError):
            return any(run.status().phase == "running" for run in RunningSystem.all(self.environment))
        return False

    def gone(self, process_id: int) -> bool:
        """Whether a process has ended."""
        return parent_of(process_id) == 0

    def joshua(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Runs a command of the program as another terminal would."""
        return subprocess.run(
            [sys.executable, "-m", "joshua.cli.main", *arguments],
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=90,
        )

    def stop(self) -> str:
        """Ends the run by Ctrl-C; returns all that it has printed."""
        self.process.send_signal(signal.SIGINT)
        return self.process.communicate(timeout=60)[0]


@contextmanager
def running(folder: Path, domain_id: int, overrides: tuple[str, ...]) -> Iterator[Rig]:
    """Runs the teleoperation until its follower has torque; kills what is left of it in the end."""
    with (
        EmulatedBus(arm="so_arm100", calibrated=True, identity="LEADER") as leader,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="FOLLOWER") as follower,
        teleoperation(leader, follower, folder, domain_id, overrides=overrides) as process,
    ):
        deadline_s = time.monotonic() + 60
        while {servo["energised"] for servo in follower.servos()} != {True}:
            if process.poll() is not None or time.monotonic() > deadline_s:
                process.kill()
                pytest.fail(process.communicate()[0])
            time.sleep(0.02)
        (guardian,) = [number for number in descendants_of(process.pid) if is_guardian(number)]
        driver = parent_of(guardian)
        assert title_of(driver) == "follower_arm"
        environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(domain_id),
            "XDG_RUNTIME_DIR": str(folder / "run"),
        }
        tree = (driver, guardian, parent_of(driver))
        rig = Rig(process, folder, environment, leader, follower, *tree)
        rig.wait(rig.is_ready)  # a run that is stopped before ends in another way
        try:
            yield rig
        finally:
            left = descendants_of(process.pid)
            process.kill()
            rig.wait(lambda: all(rig.gone(number) for number in [*left, driver, guardian]))
