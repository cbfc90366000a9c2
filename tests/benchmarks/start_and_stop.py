"""Time from the start of the process to readiness and first message, and of the stop: three mock nodes.

Counted from before the interpreter starts. Run: python tests/benchmarks/start_and_stop.py [ROUNDS]
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
ROUNDS = 10
TARGET_START_S, TARGET_STOP_S = 0.6, 0.4


def main() -> None:
    """Runs the preset and prints the figures."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else ROUNDS
    figures: dict[str, list[float]] = {}
    for _ in range(rounds):
        for name, value in one_round().items():
            figures.setdefault(name, []).append(value)
    print(f"{rounds} rounds of configs/test_mock_hardware.pbtxt; load average {os.getloadavg()[0]:.1f}")
    for name, values in figures.items():
        print(
            f"{name:32} median {statistics.median(values):.3f} s  "
            f"least {min(values):.3f} s  most {max(values):.3f} s"
        )
    print(f"targets: ready and first message {TARGET_START_S} s, stop {TARGET_STOP_S} s")


def one_round() -> dict[str, float]:
    """Runs the preset once in a fresh process."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {
            **os.environ,
            "XDG_RUNTIME_DIR": folder,
            "JOSHUA_LOG_DIR": folder,
            "ROS_DOMAIN_ID": "94",
        }
        began_s = time.monotonic()
        result = subprocess.run(
            [sys.executable, __file__, "--child", repr(began_s)],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        ended_s = time.monotonic()
    report = json.loads(result.stdout.splitlines()[-1])
    return {
        "start to all ready": report["ready_s"],
        "start to first message": report["first_message_s"],
        "stop request to last exit": report["stop_s"],
        "whole run less its duration": ended_s - began_s - 1.0,
    }


def child(began_s: float) -> None:
    """The command line's own way, with another clock and a report at the end."""
    from joshua.supervisor import fork_server

    server = fork_server.start()
    from joshua.planner.pipeline import examine
    from joshua.planner.request import Purpose, Request
    from joshua.supervisor.policies import SupervisorOptions
    from joshua.supervisor.supervisor import Supervisor

    examination = examine(
        Request(path=str(ROOT / "configs/test_mock_hardware.pbtxt"), purpose=Purpose.LAUNCH)
    )
    if examination.plan is None:
        raise SystemExit(str(examination.diagnostics))
    options = SupervisorOptions(duration_s=1.0, began_s=began_s)
    report = Supervisor(examination.plan, server, options).run()
    server.close()
    print(report.model_dump_json())


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        child(float(sys.argv[2]))
    else:
        main()
