"""A running simulation: pace over a minute, and how long a mirrored message takes to become the state."""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


def joshua(*arguments: str) -> subprocess.Popen[str]:
    """Starts the program."""
    return subprocess.Popen(
        [sys.executable, "-m", "joshua.cli.main", *arguments],
        env=os.environ | {"ROS_DOMAIN_ID": os.environ.get("ROS_DOMAIN_ID", "171")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def found(pattern: str, text: str) -> str:
    """The first group of a pattern; fails with the whole text."""
    match = re.search(pattern, text)
    assert match is not None, text
    return match[1]


def mirror(duration_s: float) -> None:
    """The twin follows an emulated robot's follower at 50 Hz."""
    robot = joshua(
        "--config", str(CONFIGS / "teleop_so_arm100.pbtxt"), "--emulate", "--duration", str(duration_s + 8)
    )
    twin = joshua("--config", str(CONFIGS / "sim_mirror.pbtxt"), "--duration", str(duration_s))
    text, _ = twin.communicate()
    robot.terminate()
    robot.communicate()
    lag_ms = float(found(r"from arrival to state p50 ([0-9.]+) ms", text))
    factor = float(found(r"real-time factor ([0-9.]+)", text))
    count = found(r"mirror: (\d+) messages", text)
    print(
        f"MIRROR at 50 Hz, {count} messages: arrival to state p50 {lag_ms:.2f} ms   target ≤ 2 ms", end=": "
    )
    print("reached" if lag_ms <= 2 else "missed")
    print(f"real-time factor over {duration_s:g} s: {factor:.3f}   target 1.00 ± 0.01", end=": ")
    print("reached" if abs(factor - 1) <= 0.01 else "missed")


def whole_loop(duration_s: float) -> None:
    """Emulated buses, drivers and physics together, teleoperation at 50 Hz."""
    run = joshua(
        "--config",
        str(CONFIGS / "teleop_so_arm100.pbtxt"),
        "--emulate",
        "--sim",
        "--duration",
        str(duration_s),
    )
    text, _ = run.communicate()
    print(f"--emulate --sim, {duration_s:g} s:")
    for line in text.splitlines():
        if re.match(r"/\S+ +(timer control|out /\S+/joint_states)|ended", line):
            print(f"  {line}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=60.0)
    arguments = parser.parse_args()
    print(f"load average {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["JOSHUA_LOG_DIR"] = folder
        mirror(arguments.duration)
        whole_loop(min(arguments.duration, 30))
