"""From an event to the first byte of the safe state at the wire, measured at the emulator.

Each round runs the teleoperation preset on two emulated arms, causes one event, and takes the emulator's time
of the first write that only the safe state makes: torque off, or for an arm that holds, the torque limit of
its gripper, which a hold lowers together with the goals. All processes share the monotonic clock. The figures
are ratios to the goal of each event, and to a safe stop of an arm that nobody drives.

Root drops to a user without rights of its own and without real-time priority, because a robot runs as such a
user. `--stress` measures beside `stress-ng --cpu 4`, with three times the time allowed, and counts the faults
of a run that nothing happens to.
Run: python tests/benchmarks/safe_state_latency.py [--rounds N] [--stress] [--events driver,estop]
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import resource
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "support"))

from emulated_teleop import JOSHUA, teleoperation
from joshua.devices.calibration import ArmCalibration
from joshua.guardian.order import HANG_LIMIT_S
from joshua.tools import CallError, RunningSystem
from joshua_emulator import EmulatedBus
from joshua_servo.register import Register
from joshua_sts3215.actuator import Sts3215Actuator
from joshua_sts3215.family import STS3215
from joshua_sts3215.registers import TORQUE_LIMIT
from joshua_sts3215.safe_stop import Sts3215StopRequest
from joshua_sts3215.settings import Sts3215Settings
from processes import descendants_of, is_guardian, parent_of

#: Goals for the median on a quiet machine.
GOALS_S = {
    "driver": 0.010,
    "driver-hold": 0.010,
    "supervisor": 0.040,
    "guardian+driver": 0.300,
    "hang": HANG_LIMIT_S + 0.100,
    "estop": 0.250,
}
TITLES = {
    "driver": "driver killed",
    "driver-hold": "driver killed, HOLD",
    "supervisor": "supervisor killed",
    "guardian+driver": "guardian and driver killed",
    "hang": "driver stopped (hang)",
    "estop": "joshua estop",
}

STRESS_FACTOR = 3.0
STRESS_LIMIT_S = 900
STRESS_START_S = 1.0
BUSY_LOOP = [sys.executable, "-c", "while True: pass"]
QUIET_RUN_S = 20.0
SAFE_STATE = "robot.actions[1].safe_state={}"
USER = 65534


class NotStartedError(Exception):
    """A run did not come up, as on a machine that gives the emulators no time; no figure comes of it."""


@dataclass
class Rig:
    """A run whose follower has torque."""

    process: subprocess.Popen[str]
    folder: Path
    follower: EmulatedBus
    driver: int
    guardian: int

    def joshua(self, *words: str) -> subprocess.Popen[str]:
        """Starts a command of the program, as a shell does."""
        environment = environment_of(self.folder)
        return subprocess.Popen(
            [str(JOSHUA), *words],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )


def ordinary_user() -> None:
    """Continues this program as a user who may neither use real-time priority nor write what root owns.

    The user may read what root may, because the interpreter can be in root's home.
    """
    for limit in (resource.RLIMIT_RTPRIO, resource.RLIMIT_NICE):
        resource.setrlimit(limit, (0, 0))
    if os.getuid() != 0:
        return
    setpriv = shutil.which("setpriv")
    if setpriv is None:
        sys.exit("setpriv is missing: install util-linux, or run this as an ordinary user")
    folder = tempfile.mkdtemp(prefix="safe-", dir="/tmp")  # short: it will hold the sockets of the runs
    os.chown(folder, USER, USER)
    program = [setpriv, f"--reuid={USER}", f"--regid={USER}", "--clear-groups", "--no-new-privs"]
    program += [f"--{kind}=-all,+dac_read_search" for kind in ("inh-caps", "ambient-caps", "bounding-set")]
    places = dict.fromkeys(("HOME", "TMPDIR", "XDG_RUNTIME_DIR"), folder)
    environment = {**os.environ, **places, "PYTHONDONTWRITEBYTECODE": "1"}
    words = [sys.executable, *sys.argv]
    code = subprocess.call([*program, *words], env=environment)
    shutil.rmtree(folder, ignore_errors=True)
    sys.exit(code)


@contextlib.contextmanager
def stress(wanted: bool) -> Iterator[str]:
    """Keeps the processors busy. Yields by what."""
    if not wanted:
        yield "no load beside it"
        return
    name = shutil.which("stress-ng")
    # A time limit, because nobody ends the load if this program is killed.
    limits = ["--timeout", f"{STRESS_LIMIT_S}", "--temp-path", tempfile.gettempdir()]
    words = [name, "--cpu", "4", "--quiet", *limits] if name else BUSY_LOOP
    loads = [subprocess.Popen(words, start_new_session=True) for _ in range(1 if name else 4)]
    try:
        time.sleep(STRESS_START_S)
        if any(load.poll() is not None for load in loads):
            sys.exit(f"{words[0]} has ended, so there is no load to measure beside")
        yield "beside stress-ng --cpu 4" if name else "beside four busy loops"
    finally:
        for load in loads:
            os.killpg(load.pid, signal.SIGKILL)
            load.wait()


@contextlib.contextmanager
def running(domain_id: int, safe_state: str = "RELEASE") -> Iterator[Rig]:
    """Runs the teleoperation until its follower has torque and every node is ready."""
    with (
        tempfile.TemporaryDirectory() as name,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="LEADER") as leader,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="FOLLOWER") as follower,
        teleoperation(
            leader, follower, Path(name), domain_id, overrides=(SAFE_STATE.format(safe_state),)
        ) as process,
    ):
        folder = Path(name)
        await_torque(process, follower)
        while not is_ready(folder):
            await_torque(process, follower)
            time.sleep(0.05)
        (guardian,) = [number for number in descendants_of(process.pid) if is_guardian(number)]
        rig = Rig(process, folder, follower, parent_of(guardian), guardian)
        try:
            yield rig
        finally:
            left = descendants_of(process.pid)
            process.kill()
            while any(parent_of(number) for number in [*left, rig.driver, rig.guardian]):
                time.sleep(0.01)


def await_torque(process: subprocess.Popen[str], follower: EmulatedBus) -> None:
    """Waits until the follower has torque."""
    while {servo["energised"] for servo in follower.servos()} != {True}:
        if process.poll() is not None:
            raise NotStartedError(f"the run ended with {process.returncode} before its follower had torque")
        time.sleep(0.02)


def environment_of(folder: Path) -> dict[str, str]:
    """Environment of the run below a folder, for its commands."""
    return {**os.environ, "XDG_RUNTIME_DIR": str(folder / "run")}


def is_ready(folder: Path) -> bool:
    """Whether every node of the run is ready."""
    with contextlib.suppress(CallError):
        return RunningSystem.find(environment=environment_of(folder)).status().phase == "running"
    return False


def seconds_to_write(follower: EmulatedBus, since: int, begun_ns: int, register: Register) -> float:
    """Waits for the first write of a register after an event. Returns the seconds between both."""
    while True:
        for entry in follower.log("write", "sync_write", since=since):
            if entry["t_ns"] >= begun_ns and entry["parameters"].startswith(f"{register.address:02x}"):
                return float(entry["t_ns"] - begun_ns) / 1e9
        time.sleep(0.02)


def one_round(event: str, domain_id: int) -> float:
    """Seconds from an event to the first byte of the safe state."""
    holds = event == "driver-hold"
    with running(domain_id, "HOLD" if holds else "RELEASE") as rig:
        time.sleep(random.uniform(0.4, 0.6))  # at every place of the loops' own rhythm
        targets = {
            "driver-hold": [rig.driver],
            "driver": [rig.driver],
            "hang": [rig.driver],
            "supervisor": [rig.process.pid],
            "guardian+driver": [rig.guardian, rig.driver],
        }
        since = rig.follower.log()[-1]["sequence"]
        number = signal.SIGSTOP if event == "hang" else signal.SIGKILL
        begun_ns = time.monotonic_ns()
        for process_id in targets[event]:
            os.kill(process_id, number)
        register = TORQUE_LIMIT if holds else STS3215.torque_enable
        return seconds_to_write(rig.follower, since, begun_ns, register)


def estops(rounds: int, domain_id: int) -> list[float]:
    """Seconds from the start of each `joshua estop` to the first byte, in one run."""
    times = []
    with running(domain_id) as rig:
        for _ in range(rounds):
            time.sleep(random.uniform(0.4, 0.6))
            since = rig.follower.log()[-1]["sequence"]
            begun_ns = time.monotonic_ns()
            command = rig.joshua("estop")
            times.append(seconds_to_write(rig.follower, since, begun_ns, STS3215.torque_enable))
            command.communicate()
            rig.joshua("estop", "--release").communicate()
            while not resumed(rig):
                time.sleep(0.05)
            await_torque(rig.process, rig.follower)
    return times


def resumed(rig: Rig) -> bool:
    """Whether the follower could be given torque again."""
    try:
        system = RunningSystem.find(environment=environment_of(rig.folder))
        system.call("/follower_arm", "resume", start=True)
    except CallError:
        return False
    return True


def baseline_s() -> float:
    """Seconds from a request to its first byte at the wire, where no process has to end first."""
    with EmulatedBus(arm="so_arm100", calibrated=True, identity="ARM") as arm:
        ids = tuple(servo["id"] for servo in arm.servos())
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
        since = arm.log()[-1]["sequence"]
        begun_ns = time.monotonic_ns()
        request = Sts3215StopRequest("RELEASE", ids, path=arm.port, device_root=str(arm.root), echo=False)
        report = request.run()
        if not report.complete:
            raise RuntimeError(report.detail)
        return seconds_to_write(arm, since, begun_ns, STS3215.torque_enable)


def false_faults(domain_id: int, duration_s: float) -> list[str]:
    """Errors in the log of a run that nothing happens to."""
    with running(domain_id) as rig:
        time.sleep(duration_s)
        entries = [
            json.loads(line)
            for path in (rig.folder / "log").glob("*.jsonl")
            for line in path.read_text(encoding="utf-8").splitlines()
        ]
        found = [entry["text"] for entry in entries if entry["level"] in ("error", "critical")]
        energised = {servo["energised"] for servo in rig.follower.servos()}
        return found if energised == {True} else [*found, "the follower has lost its torque"]


def measured(event: str, rounds: int, domain_id: int) -> list[float]:
    """The times of one event. A run that did not come up is started anew."""
    times: list[float] = []
    failures = 0
    while len(times) < rounds:
        try:
            times += estops(rounds, domain_id) if event == "estop" else [one_round(event, domain_id)]
        except NotStartedError as error:
            failures += 1
            print(f"started anew: {error}", flush=True)
            if failures > rounds:
                raise
    return times


def show(title: str, times_s: list[float], bare_s: float, goal_s: float) -> None:
    """Prints one line."""
    median_s = statistics.median(times_s)
    print(
        f"{title:27} min {min(times_s) * 1e3:7.1f}  median {median_s * 1e3:7.1f}  "
        f"max {max(times_s) * 1e3:7.1f} ms; median {median_s / goal_s:5.2f} × goal ({goal_s * 1e3:.0f} ms), "
        f"{median_s / bare_s:6.1f} × baseline",
        flush=True,
    )


def main() -> None:
    """Prints the figures of each event."""
    parser = argparse.ArgumentParser(description="From an event to the first byte of the safe state")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--stress", action="store_true", help="beside stress-ng --cpu 4")
    parser.add_argument("--events", default=",".join(GOALS_S), help="some of them, separated by commas")
    arguments = parser.parse_args()
    ordinary_user()
    rounds, events = arguments.rounds, arguments.events.split(",")
    factor = STRESS_FACTOR if arguments.stress else 1.0
    with stress(arguments.stress) as load:
        print(
            f"user {os.getuid()}, {load}, load average {os.getloadavg()[0]:.1f}, {rounds} rounds", flush=True
        )
        bare_s = statistics.median(baseline_s() for _ in range(rounds))
        print(f"{'baseline':27} median {bare_s * 1e3:.1f} ms: a safe stop with nobody on the bus", flush=True)
        for index, event in enumerate(events):
            times_s = measured(event, rounds, 110 + index)
            show(TITLES[event], times_s, bare_s, GOALS_S[event] * factor)
        if arguments.stress:
            found = false_faults(109, QUIET_RUN_S)
            print(f"false faults in {QUIET_RUN_S:g} s: {len(found)}", *found, sep="\n  ")


if __name__ == "__main__":
    main()
