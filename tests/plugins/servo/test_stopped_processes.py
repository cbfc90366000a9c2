"""Processes that are stopped (SIGSTOP): the driver and the emulator of its servos, together and alone."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from joshua.api import DeviceError
from joshua_emulator import EmulatedBus
from servo_families import Kind

SUPPORT = Path(__file__).parents[2] / "support"

#: A driver that starts and stops an arm again and again. It prints a line after each round.
DRIVER = """
import json, sys
from joshua.devices.context import ActuatorContext
from joshua.plan import ActuatorFacts
from servo_families import KINDS

protocol, rounds, settings = sys.argv[1], int(sys.argv[2]), json.loads(sys.argv[3])
kind = next(kind for kind in KINDS if kind.protocol == protocol)
arm = kind.actuator(kind.settings_type.model_validate(settings), ActuatorContext(ActuatorFacts()))
for _ in range(rounds):
    arm.connect()
    arm.enable()
    arm.release()
    arm.disconnect()
    print("round", flush=True)
"""


@contextmanager
def stopped(*processes: int) -> Iterator[None]:
    """Stops processes meanwhile, the servos' first: what the driver then sends is not lost."""
    for process in processes:
        os.kill(process, signal.SIGSTOP)
    try:
        yield
    finally:
        for process in reversed(processes):
            os.kill(process, signal.SIGCONT)


@pytest.mark.parametrize("servos_too", [True, False])
def test_an_arm_starts_and_stops_however_its_processes_are_stalled(
    servos_too: bool, kind: Kind, arm_emulator: EmulatedBus
) -> None:
    settings = kind.settings_of(arm_emulator)
    rounds = 20
    driver = subprocess.Popen(
        [sys.executable, "-c", DRIVER, kind.protocol, str(rounds), json.dumps(settings)],
        env={**os.environ, "PYTHONPATH": str(SUPPORT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with driver:
        assert driver.stdout is not None
        assert driver.stderr is not None
        assert driver.stdout.readline() == "round\n", driver.stderr.read()
        stalled = [arm_emulator.pid, driver.pid] if servos_too else [driver.pid]
        for number in range(8):
            if driver.poll() is not None:
                break
            time.sleep(0.02 + 0.033 * number)  # another point of a round each time
            with stopped(*stalled):
                time.sleep(0.5 + 0.025 * number)
        output, errors = driver.communicate(timeout=60)
    assert driver.returncode == 0, errors
    assert output.count("round") == rounds - 1


def test_servos_that_are_stopped_are_silent_until_they_go_on(
    kind: Kind, arm_emulator: EmulatedBus
) -> None:
    arm = kind.driver(arm_emulator)
    arm.connect()
    try:
        with stopped(arm_emulator.pid):
            with pytest.raises(DeviceError, match=r"no servo answers: no reply to \d+ requests in 0\.\d+ s"):
                arm.prepare()
            with pytest.raises(DeviceError, match="does not confirm that its torque is off"):
                arm.release()
        arm.enable()
        arm.release()
    finally:
        arm.disconnect()
