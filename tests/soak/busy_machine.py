"""Teleoperation beside four busy loops: no driver is taken for hung, and a driver that hangs is.

Both arms are emulated. Beside the run, four processes compute without a pause. First as a user without any
grant; then with real-time priority for the threads of both drivers and the guardian, where this program may
give it (root). In each case the follower is stopped (SIGSTOP) at the end: its guardian must act within the
limit and the time that the machine takes.
Run: python tests/soak/busy_machine.py [SECONDS]
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "support"))

from guarded_arm import RELEASE, Rig, running
from joshua.guardian.order import HANG_LIMIT_S
from joshua.testing.domain import reserved_domain
from processes import descendants_of, title_of

BUSY_LOOPS = 4
BUSY = "while True: pass"
LOOK_S = 0.02

#: From the hang to the torque off: the limit, and the work of the guardian, which waits for a processor, too.
CAUGHT_WITHIN_S = HANG_LIMIT_S + 1.0


@contextlib.contextmanager
def busy_loops(count: int) -> Iterator[None]:
    """Runs programs that compute without a pause."""
    loops = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def waited_s(process_id: int) -> float:
    """Time in which the main thread of a process waited for a processor so far."""
    return int(Path(f"/proc/{process_id}/schedstat").read_text().split()[1]) / 1e9


def prefer(processes: list[int]) -> bool:
    """Gives SCHED_RR to all threads of some processes; returns whether this user may."""
    try:
        for process_id in processes:
            for thread in os.listdir(f"/proc/{process_id}/task"):
                os.sched_setscheduler(int(thread), os.SCHED_RR, os.sched_param(1))
    except PermissionError:
        return False
    return True


def run(seconds: float, *, realtime: bool) -> list[str]:
    """Teleoperates and then stops the follower's driver; returns what broke a requirement."""
    name = "SCHED_RR" if realtime else "no grant"
    with (
        reserved_domain() as domain_id,
        tempfile.TemporaryDirectory() as folder,
        running(Path(folder), domain_id, RELEASE) as rig,
    ):
        drivers = [item for item in descendants_of(rig.process.pid) if title_of(item).endswith("_arm")]
        if realtime and not prefer([*drivers, rig.guardian]):
            print("SCHED_RR: this user may not give it, left out")
            return []
        with busy_loops(BUSY_LOOPS):
            before_s, began_s = waited_s(rig.driver), time.monotonic()
            while (
                time.monotonic() - began_s < seconds
                and rig.energised() == {True}
                and not rig.gone(rig.driver)
            ):
                time.sleep(0.5)
            teleoperated_s = time.monotonic() - began_s
            share = 0.0 if rig.gone(rig.driver) else (waited_s(rig.driver) - before_s) / teleoperated_s
            if teleoperated_s < seconds:
                print(f"{name}: torque by servo: {[servo['energised'] for servo in rig.follower.servos()]}")
                time.sleep(5.0)  # on a busy machine the log is late
            log = "".join(path.read_text() for path in (Path(folder) / "log").glob("*.jsonl"))
            caught_s = math.inf if rig.gone(rig.driver) else hang(rig)
        rig.stop()
    print(
        f"{name}: {teleoperated_s:.0f} s, of which the follower's loop waited {share:.0%} for a processor;",
        end=" ",
    )
    print(f"a stopped driver was caught in {caught_s:.2f} s (at most {CAUGHT_WITHIN_S:g} s)")
    problems = [f"{name}: it ended after {teleoperated_s:.0f} s"] * (teleoperated_s < seconds)
    wrong = ('"WARNING"', '"ERROR"', '"CRITICAL"') if teleoperated_s < seconds else ('"ERROR"', '"CRITICAL"')
    problems += [f"{name}: {line}" for line in log.splitlines() if any(level in line for level in wrong)]
    problems += [f"{name}: the hang was caught after {caught_s:.2f} s"] * (caught_s > CAUGHT_WITHIN_S)
    return problems


def hang(rig: Rig) -> float:
    """Stops the driver; returns how long the servos keep their torque, infinity for more than 10 s."""
    began_s = time.monotonic()
    os.kill(rig.driver, signal.SIGSTOP)
    while rig.energised() != {False}:
        if time.monotonic() - began_s > 10.0:
            return math.inf
        time.sleep(LOOK_S)
    return time.monotonic() - began_s


def main() -> None:
    """Prints what was seen; exit code 1 where a requirement is broken."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 600.0
    problems = [*run(seconds, realtime=False), *run(min(seconds, 60.0), realtime=True)]
    print(f"load average {os.getloadavg()[0]:.1f}: {'; '.join(problems) or 'nothing wrong'}")
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
