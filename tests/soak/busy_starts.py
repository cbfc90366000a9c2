"""Emulated runs that start beside four busy processes: none fails, none takes a delay for a silent servo.

Each run has two arms. `stress-ng --cpu 4` computes beside them where it is installed, otherwise four Python
loops do.
Run: python tests/soak/busy_starts.py [COUNT]
"""

from __future__ import annotations

import contextlib
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "support"))

from joshua.testing.domain import reserved_domain

JOSHUA = Path(sys.executable).parent / "joshua"
PRESET = "teleop_so_arm100"
BUSY_PROCESSES = 4
BUSY = "while True: pass"
START_TIMEOUT_S = 600.0

#: Lines of a log that blame a device.
BLAMES = ("no servo answers", "does not answer", "no longer answers", "the adapter is gone")

#: Lines of a log that tell of a delay. The emulated servos are processes of the same machine.
DELAYS = ("no reply for",)


@contextlib.contextmanager
def busy_processes() -> Iterator[None]:
    """Runs processes that compute without a pause."""
    stress = shutil.which("stress-ng")
    command = [stress, "--cpu", "1", "--quiet"] if stress else [sys.executable, "-c", BUSY]
    running = [subprocess.Popen(command) for _ in range(BUSY_PROCESSES)]
    try:
        yield
    finally:
        for process in running:
            process.terminate()
            process.wait()


def start(folder: Path, domain_id: int) -> tuple[float, str, str]:
    """Starts a run that lasts a second; returns its whole duration, what went wrong, and what was delayed."""
    (folder / "run").mkdir(mode=0o700)
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(domain_id),
        "XDG_RUNTIME_DIR": str(folder / "run"),
        "XDG_STATE_HOME": str(folder / "state"),
    }
    began_s = time.monotonic()
    result = subprocess.run(
        [
            JOSHUA,
            "--config",
            f"configs/{PRESET}.pbtxt",
            "--emulate",
            "--duration",
            "1",
            "--start-timeout",
            "60",
        ],
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=START_TIMEOUT_S,
        check=False,
    )
    took_s = time.monotonic() - began_s
    output = result.stdout + result.stderr
    blames = lines_with(BLAMES, output)
    if result.returncode:
        blames = f"exit code {result.returncode}:\n{output}"
    return took_s, blames, lines_with(DELAYS, output)


def lines_with(parts: tuple[str, ...], text: str) -> str:
    """The lines of a text that contain one of some parts."""
    return "\n".join(line for line in text.splitlines() if any(part in line for part in parts))


def main() -> None:
    """Prints what was seen; exit code 1 where a start failed."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    durations_s = []
    problems = []
    delayed = 0
    with reserved_domain() as domain_id, busy_processes():
        for number in range(1, count + 1):
            with tempfile.TemporaryDirectory() as folder:
                took_s, problem, delays = start(Path(folder), domain_id)
            durations_s.append(took_s)
            delayed += bool(delays)
            print(f"start {number}: {took_s:.1f} s {problem or delays}", flush=True)
            if problem:
                problems.append(problem)
    print(
        f"{count} starts beside {BUSY_PROCESSES} busy processes, {statistics.median(durations_s):.1f} s each "
        f"(at most {max(durations_s):.1f} s), load average {os.getloadavg()[0]:.1f}: {len(problems)} failed, "
        f"{delayed} with a delay of a servo"
    )
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
