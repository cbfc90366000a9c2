"""From SIGKILL of a driver to the safe state on the wire, measured at the emulator.

A driver process moves an emulated arm; a second process waits at a pipe, as a guardian does, and runs the
safe stop when the driver has been killed. Times are of the monotonic clock, which all processes share; the
end is the emulator's own record of the last motor that lost its torque, or of the last goal that held it.
The time that the second process needs to notice the death is part of the figure.
Both families of servo buses are measured.
Run: python tests/benchmarks/servo_safe_stop.py
"""

from __future__ import annotations

import itertools
import json
import signal
import statistics
import subprocess
import sys
import time
from typing import Any

from joshua_emulator import EmulatedBus
from joshua_servo.safe_stop import ServoStopRequest

ROUNDS = 12
IDS = (1, 2, 3, 4, 5, 6)

# Options of the emulator, package and class names of the driver, and what its settings need besides.
FAMILIES: dict[str, tuple[dict[str, Any], str, str, dict[str, Any]]] = {
    "STS3215": ({"arm": "so_arm100"}, "joshua_sts3215", "Sts3215", {}),
    "Dynamixel": (
        {"protocol": "dynamixel", "arm": "koch"},
        "joshua_dynamixel",
        "Dynamixel",
        {"models": ["xl330-m077"]},
    ),
}

DRIVER = """
import importlib, sys, json, numpy as np
package, name = sys.argv[2:]
actuator = getattr(importlib.import_module(package + ".actuator"), name + "Actuator")
settings = getattr(importlib.import_module(package + ".settings"), name + "Settings")
arm = actuator(settings.model_validate_json(sys.argv[1]))
arm.connect()
arm.enable()
print("driving", flush=True)
goal = arm.read().position_rad
while True:
    goal = np.clip(goal + 0.002, arm.limits.position_min_rad, arm.limits.position_max_rad)
    arm.read()
    arm.write(goal)
"""

GUARDIAN = """
import json, sys
from joshua.guardian.main import load_action
act, values = load_action(sys.argv[2]), json.loads(sys.argv[1])
print("watching", flush=True)
sys.stdin.buffer.read()
print(json.dumps(act(values)), flush=True)
"""


def one_round(family: str, action: str) -> tuple[float, float]:
    """Kills a driver once; returns seconds until the state was on the wire and until it was verified."""
    options, package, name, further = FAMILIES[family]
    with EmulatedBus(calibrated=True, identity="ARM1", **options) as emulator:
        settings = {
            "port": emulator.port,
            "device_root": str(emulator.root),
            "motor_ids": IDS,
            "calibration": emulator.calibration(),
            **further,
        }
        request = ServoStopRequest(action, IDS, path=emulator.port, device_root=str(emulator.root))
        driver = subprocess.Popen(
            [sys.executable, "-c", DRIVER, json.dumps(settings), package, name],
            stdout=subprocess.PIPE,
            text=True,
        )
        stop = f"{package}.safe_stop:{name}StopRequest"
        guardian = subprocess.Popen(
            [
                sys.executable,
                "-c",
                GUARDIAN,
                json.dumps(request.to_values()),
                stop,
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert driver.stdout is not None
        assert guardian.stdin is not None
        assert guardian.stdout is not None
        driver.stdout.readline()
        guardian.stdout.readline()
        time.sleep(0.3)  # let the driver drive
        before = emulator.log()[-1]["sequence"]
        killed_ns = time.monotonic_ns()
        driver.send_signal(signal.SIGKILL)
        driver.wait()
        guardian.stdin.close()
        report = json.loads(guardian.stdout.readline())
        verified_ns = time.monotonic_ns()
        guardian.wait()
        if not report["complete"]:
            raise RuntimeError(f"the safe stop did not complete: {report['detail']}")
        event = "torque" if action == "RELEASE" else "sync_write"
        applied_ns = max(entry["t_ns"] for entry in emulator.log(event, since=before))
        for process in (driver, guardian):
            assert process.stdout is not None
            process.stdout.close()
        return (applied_ns - killed_ns) / 1e9, (verified_ns - killed_ns) / 1e9


def main() -> None:
    """Prints the figures of each action."""
    for family, action in itertools.product(FAMILIES, ("RELEASE", "HOLD")):
        rounds = [one_round(family, action) for _ in range(ROUNDS)]
        applied, verified = zip(*rounds, strict=True)
        print(
            f"{family:<10}{action:<8} SIGKILL to the wire: median {statistics.median(applied) * 1e3:.1f} ms, "
            f"max {max(applied) * 1e3:.1f} ms; verified by reading back: median "
            f"{statistics.median(verified) * 1e3:.1f} ms, max {max(verified) * 1e3:.1f} ms ({ROUNDS} rounds)"
        )


if __name__ == "__main__":
    main()
