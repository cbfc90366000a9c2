"""From the end of a driver or a supervisor to the released arm, measured at the emulator.

Each round runs the teleoperation preset on two emulated arms, ends one process by a signal (or latches an
e-stop while all is well), and takes the emulator's own record of the last motor that lost its torque. All
processes share the monotonic clock. The baseline is the safe stop of an arm that nobody drives: what the port
and the wire take.
Run: python tests/benchmarks/guardian.py [ROUNDS]
"""

from __future__ import annotations

import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypeVar

sys.path.append(str(Path(__file__).parents[1] / "support"))

from emulated_teleop import teleoperation
from joshua.devices.calibration import ArmCalibration
from joshua.guardian.latch import LatchFolder
from joshua.guardian.order import HANG_LIMIT_S
from joshua.ipc.client import CallError, RunningSystem, all_systems
from joshua_emulator import EmulatedBus
from joshua_sts3215.actuator import Sts3215Actuator
from joshua_sts3215.safe_stop import Sts3215StopRequest
from joshua_sts3215.settings import Sts3215Settings
from processes import descendants_of, is_guardian, parent_of

T = TypeVar("T")

LIMITS_S = {"driver SIGKILL": 0.150, "supervisor SIGKILL": 0.300, "driver SIGSTOP": HANG_LIMIT_S + 0.150}


class NotStartedError(Exception):
    """A run did not come up, as on a machine that gives the emulators no time; no figure comes of it."""


def started(measure: Callable[[], T]) -> T:
    """Measures, anew where a run did not come up."""
    for _ in range(4):
        try:
            return measure()
        except NotStartedError as error:
            print(f"measured anew: {error}")
    return measure()


def baseline_s() -> float:
    """Seconds from the request to the last motor without torque, where no process has to end first."""
    with EmulatedBus(arm="so_arm100", calibrated=True, identity="ARM") as arm:
        ids = tuple(servo["id"] for servo in arm.servos())
        before = arm.log()[-1]["sequence"]
        driver = Sts3215Actuator(
            Sts3215Settings(
                port=arm.port,
                device_root=str(arm.root),
                motor_ids=ids,
                calibration=ArmCalibration.model_validate(arm.calibration()),
            )
        )
        driver.connect()
        driver.enable()
        driver.disconnect()
        begun_ns = time.monotonic_ns()
        report = Sts3215StopRequest("RELEASE", ids, path=arm.port, device_root=str(arm.root)).run()
        if not report.complete:
            raise RuntimeError(report.detail)
        ended_ns = max(entry["t_ns"] for entry in arm.log("torque", since=before))
        return float(ended_ns - begun_ns) / 1e9


def estops_s(rounds: int, domain_id: int) -> list[float]:
    """Seconds from each latch to the last motor without torque, in one run that is resumed each time."""
    with (
        tempfile.TemporaryDirectory() as folder,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="LEADER") as leader,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="FOLLOWER") as follower,
        teleoperation(leader, follower, Path(folder), domain_id) as process,
    ):
        await_torque(process, follower)
        base = Path(folder) / "run" / "joshua"
        ((path, info),) = all_systems(base)
        latches = LatchFolder(base / "estop")
        times = []
        for index in range(rounds):
            time.sleep(0.3 + 0.05 * index / rounds)  # at every place of the drivers' own rhythm
            before = follower.log()[-1]["sequence"]
            begun_ns = time.monotonic_ns()
            latch = latches.set(info.robot, info.source, info.domain_id, info.actuators)
            while {servo["energised"] for servo in follower.servos()} != {False}:
                time.sleep(0.01)
            ended_ns = max(entry["t_ns"] for entry in follower.log("torque", since=before))
            times.append(float(ended_ns - begun_ns) / 1e9)
            latches.clear(latch)
            while not resumed(RunningSystem(path, info)):
                time.sleep(0.05)
            await_torque(process, follower)
        return times


def resumed(system: RunningSystem) -> bool:
    """Whether the follower could be given torque again."""
    try:
        system.call("/follower_arm", "resume", start=True)
    except CallError:
        return False
    return True


def await_torque(process: subprocess.Popen[str], follower: EmulatedBus) -> None:
    """Waits until the follower has torque."""
    while {servo["energised"] for servo in follower.servos()} != {True}:
        if process.poll() is not None:
            raise NotStartedError(f"the run ended with {process.returncode} before its follower had torque")
        time.sleep(0.02)


def one_round(case: str, domain_id: int) -> float:
    """Seconds from the signal to the last motor without torque."""
    with (
        tempfile.TemporaryDirectory() as folder,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="LEADER") as leader,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="FOLLOWER") as follower,
        teleoperation(
            leader, follower, Path(folder), domain_id, overrides=("robot.actions[1].safe_state=RELEASE",)
        ) as process,
    ):
        await_torque(process, follower)
        (guardian,) = [number for number in descendants_of(process.pid) if is_guardian(number)]
        driver = parent_of(guardian)
        time.sleep(0.4)  # let it drive
        before = follower.log()[-1]["sequence"]
        target = process.pid if case.startswith("supervisor") else driver
        number = signal.SIGSTOP if case.endswith("SIGSTOP") else signal.SIGKILL
        begun_ns = time.monotonic_ns()
        os.kill(target, number)
        while {servo["energised"] for servo in follower.servos()} != {False}:
            time.sleep(0.01)
        ended_ns = max(entry["t_ns"] for entry in follower.log("torque", since=before))
        while parent_of(guardian):
            time.sleep(0.01)
        return float(ended_ns - begun_ns) / 1e9


def main() -> None:
    """Prints the figures of each case."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    bare_s = statistics.median(baseline_s() for _ in range(rounds))
    print(
        f"{'baseline':20} median {bare_s * 1e3:6.1f} ms: a safe stop with nobody on the bus ({rounds} rounds)"
    )
    for case, limit_s in LIMITS_S.items():
        times = [started(partial(one_round, case, 110 + index)) for index in range(rounds)]
        show(case, times, bare_s, limit_s)
    show("e-stop latched", started(partial(estops_s, rounds, 109)), bare_s, None)


def show(case: str, times_s: list[float], bare_s: float, limit_s: float | None) -> None:
    """Prints one line."""
    median_s = statistics.median(times_s)
    limit = f"limit {limit_s * 1e3:.0f} ms, used {max(times_s) / limit_s:.0%}" if limit_s else "no limit set"
    print(
        f"{case:20} median {median_s * 1e3:6.1f} ms ({median_s / bare_s:5.1f} × baseline)  "
        f"max {max(times_s) * 1e3:6.1f} ms  {limit}"
    )


if __name__ == "__main__":
    main()
