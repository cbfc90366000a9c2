"""From ``joshua estop`` in a shell to torque off on the wire, in one run of the teleoperation preset.

The clock starts when the shell starts the command, and stops at the emulator's record of the first motor that
loses its torque. All processes share the monotonic clock. Beside it stand the processor time of the command,
which other programs on the machine do not change, and the delay of a latch that this process sets itself.
Run: python tests/benchmarks/estop.py [ROUNDS]
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "support"))

from emulated_teleop import JOSHUA, teleoperation
from joshua.guardian.latch import LatchFolder
from joshua.ipc.client import CallError, RunningSystem, all_systems
from joshua_emulator import EmulatedBus

DOMAIN_ID = 109
LIMIT_MS = 250


def await_torque(process: subprocess.Popen[str], follower: EmulatedBus, wanted: bool) -> None:
    """Waits until every servo has torque, or none has."""
    while {servo["energised"] for servo in follower.servos()} != {wanted}:
        if process.poll() is not None:
            raise RuntimeError(f"the run ended with {process.returncode}")
        time.sleep(0.01)


def resume(system: RunningSystem) -> None:
    """Enables torque again, as soon as the driver allows it."""
    while True:
        try:
            system.call("/follower_arm", "resume", start=True)
        except CallError:
            time.sleep(0.05)
        else:
            return


def measured(rounds: int, stops: dict[str, Callable[[RunningSystem, Path], None]]) -> dict[str, list[float]]:
    """Milliseconds from each way of an e-stop to the first motor without torque."""
    times: dict[str, list[float]] = {name: [] for name in stops}
    with (
        tempfile.TemporaryDirectory() as folder,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="LEADER") as leader,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="FOLLOWER") as follower,
        teleoperation(leader, follower, Path(folder), DOMAIN_ID) as process,
    ):
        await_torque(process, follower, True)
        base = Path(folder) / "run" / "joshua"
        ((path, info),) = all_systems(base)
        system, latches = RunningSystem(path, info), LatchFolder(base / "estop")
        time.sleep(1.0)
        for index in range(rounds):
            for name, stop in stops.items():
                time.sleep(0.5 + 0.05 * index / rounds)  # at every place of the drivers' own rhythm
                before = follower.log()[-1]["sequence"]
                began_ns = time.monotonic_ns()
                stop(system, base)
                await_torque(process, follower, False)
                first_ns = min(entry["t_ns"] for entry in follower.log("torque", since=before))
                times[name].append((first_ns - began_ns) / 1e6)
                for latch in latches.all():
                    latches.clear(latch)
                resume(system)
                await_torque(process, follower, True)
    return times


def by_command(_system: RunningSystem, base: Path) -> None:
    """Runs the command, as a shell does."""
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(base.parent), "ROS_DOMAIN_ID": str(DOMAIN_ID)}
    subprocess.run([str(JOSHUA), "estop"], env=environment, check=True, capture_output=True)


def by_latch(system: RunningSystem, base: Path) -> None:
    """Sets the latch only."""
    info = system.info
    LatchFolder(base / "estop").set(info.robot, info.source, info.domain_id, info.actuators)


def main() -> None:
    """Prints the figures."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    times = measured(rounds, {"joshua estop": by_command, "latch alone": by_latch})
    for name, values in times.items():
        print(f"{name:14} median {statistics.median(values):6.1f} ms  max {max(values):6.1f} ms")
    print(f"limit of the command on a quiet machine: median {LIMIT_MS} ms")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "XDG_RUNTIME_DIR": folder}
        subprocess.run([str(JOSHUA), "estop", "--release"], env=environment, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"processor time of a command until it has read the latches: {cpu_s * 1e3:.0f} ms")


if __name__ == "__main__":
    main()
