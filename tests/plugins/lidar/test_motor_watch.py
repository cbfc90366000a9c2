"""The motor stops when the driver is killed, and nothing happens when it ends in good order."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from eventually import eventually
from joshua_emulator import EmulatedLidar
from joshua_lidar.lidar import SerialLidar
from joshua_lidar.motor_watch import stop_scanner

SUPPORT = Path(__file__).parents[2] / "support"
DRIVER = """
import sys, time
sys.path.insert(0, sys.argv[3])
from joshua_lidar.lidar import SerialLidar
from lidar_settings import make_settings
lidar = SerialLidar(make_settings(sys.argv[1], sys.argv[2]))
lidar.connect()
print("turns", flush=True)
time.sleep(60)
"""


@pytest.mark.parametrize("model", ["rplidar_a1", "rplidar_c1", "lds01", "ydlidar_x4"])
def test_a_killed_driver(emulator_of: Callable[..., EmulatedLidar], model: str) -> None:
    emulator = emulator_of(model)
    command = [sys.executable, "-c", DRIVER, emulator.port, model, str(SUPPORT)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as driver:
        assert driver.stdout is not None
        assert driver.stdout.readline().strip() == "turns"
        assert emulator.state()["motor"]
        driver.send_signal(signal.SIGKILL)
    eventually(lambda: not emulator.state()["motor"], "the stop of the motor")
    assert not emulator.state()["scanning"]


def test_an_end_in_good_order(
    emulator_of: Callable[..., EmulatedLidar], lidar_at: Callable[..., SerialLidar]
) -> None:
    emulator = emulator_of("rplidar_a1")
    lidar = lidar_at(emulator.port, "rplidar_a1")
    lidar.connect()
    watch = lidar._watch
    assert watch is not None
    lidar.disconnect()
    with pytest.raises(ProcessLookupError):
        os.kill(watch.pid, 0)
    eventually(lambda: not emulator.state()["motor"], "the stop of the motor")
    stops = [entry for entry in emulator.log("request") if entry["command"] == 0xF0]
    assert [entry["payload"] for entry in stops] == ["9402", "0000"]  # on and off once each


def test_a_scanner_that_is_gone() -> None:
    order = {"path": "/dev/ttyUSB_none", "baudrate": 115_200, "messages": ["a525"], "dtr": None}
    from joshua_lidar import motor_watch

    patience, motor_watch.PATIENCE_S = motor_watch.PATIENCE_S, 0.1
    try:
        assert not stop_scanner(json.loads(json.dumps(order)))
    finally:
        motor_watch.PATIENCE_S = patience
