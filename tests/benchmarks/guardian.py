"""From the end of a driver or a supervisor to the released arm, measured at the emulator.

Each round runs the teleoperation preset on two emulated arms, ends one process by a signal, and takes the
emulator's own record of the last motor that lost its torque. All processes share the monotonic clock.
Run: PYTHONPATH=tests/support python tests/benchmarks/guardian.py [ROUNDS]
"""

from __future__ import annotations

import os
import signal
import statistics
import sys
import tempfile
import time
from pathlib import Path

from emulated_teleop import teleoperation
from joshua_emulator import EmulatedBus
from processes import descendants_of, is_guardian, parent_of

LIMITS_S = {"driver SIGKILL": 0.150, "supervisor SIGKILL": 0.300, "driver SIGSTOP": 0.350}


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
        while {servo["energised"] for servo in follower.servos()} != {True}:
            if process.poll() is not None:
                raise RuntimeError(process.communicate()[0])
            time.sleep(0.02)
        (guardian,) = [number for number in descendants_of(process.pid) if is_guardian(number)]
        driver = parent_of(guardian)
        time.sleep(1.0)  # let it drive
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
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    for case, limit_s in LIMITS_S.items():
        times = [one_round(case, 40 + index) for index in range(rounds)]
        print(
            f"{case:20} median {statistics.median(times) * 1e3:6.1f} ms  max {max(times) * 1e3:6.1f} ms  "
            f"limit {limit_s * 1e3:.0f} ms"
        )


if __name__ == "__main__":
    main()
