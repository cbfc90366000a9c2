"""What the control channels of all emulated devices have in common, and what the next request finds."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from joshua_emulator import EmulatedBus, EmulatedCamera, EmulatedEncoder, EmulatedGamepad, EmulatedLidar
from joshua_emulator.emulator_process import EmulatorError, EmulatorProcess


@pytest.fixture(scope="module")
def devices() -> Iterator[dict[str, EmulatorProcess]]:
    """One device of each kind that has a loop of this distribution's own."""
    kinds: dict[str, EmulatorProcess] = {
        "bus": EmulatedBus(ids=(1,)),
        "camera": EmulatedCamera(160, 120),
        "encoder": EmulatedEncoder("line"),
        "gamepad": EmulatedGamepad(),
        "lidar": EmulatedLidar("ld19"),
    }
    try:
        for device in kinds.values():
            device.start()
        yield kinds
    finally:
        for device in kinds.values():
            device.close()


@pytest.mark.parametrize(
    ("kind", "operation", "values", "message"),
    [
        ("gamepad", "set", {"values": [1]}, "set: a value is wrong ('list' object has no attribute 'items')"),
        ("gamepad", "set", {"values": {"left_trigger": -0.5}}, "left_trigger is -0.5; allowed: 0 to 1"),
        ("gamepad", "set", {"values": {"a": -1}}, "a is -1; allowed: 0 to 1"),
        ("lidar", "fault", {"kind": ["rate"]}, "fault: a value is wrong (unhashable type: 'list')"),
        ("encoder", "angle", {"t_ns": 10**400}, "angle: a number is too large"),
        ("bus", "set_register", {"name": "goal", "value": 1}, "'goal' is missing or unknown"),
    ],
)
def test_wrong_request_is_refused_and_the_device_goes_on(
    devices: dict[str, EmulatorProcess], kind: str, operation: str, values: dict, message: str
) -> None:
    with pytest.raises(EmulatorError, match=re.escape(message)):
        devices[kind].ask(operation, **values)
    assert devices[kind].ask("state")["t_ns"]


def test_wait_of_years_ends_no_device(devices: dict[str, EmulatorProcess]) -> None:
    for name, rate in (("camera", "fps"), ("gamepad", "rate_hz")):
        devices[name].fault("rate", 1e-12)  # the next frame or report is far away
        assert devices[name].ask("state")[rate] == 1e-12
        devices[name].ask("clear_faults")


def test_last_stall_counts_and_what_is_over_ends_nothing(devices: dict[str, EmulatorProcess]) -> None:
    lidar, encoder = devices["lidar"], devices["encoder"]
    for device in (lidar, encoder):
        last = device.log()[-1]["sequence"]
        device.fault("stall", 0.05)
        device.fault("stall")
        device.fault("unplug", at_s=0.2, replug_after_s=0.01)
        device.wait_for(["plug"], since=last)
    assert lidar.ask("state")["turn_hz"] == 0
    now_ns = encoder.ask("state")["t_ns"]
    assert encoder.ask("angle", t_ns=now_ns) == encoder.ask("angle", t_ns=now_ns + 10**9)
    lidar.fault("stall", 0.05)
    lidar.ask("clear_faults")
    lidar.fault("turn_hz", 3)
    last = lidar.log()[-1]["sequence"]
    lidar.fault("unplug", at_s=0.2)
    lidar.wait_for(["unplug"], since=last)
    assert lidar.ask("state")["turn_hz"] == 3
    for device in (lidar, encoder):
        device.ask("clear_faults")


def test_what_has_become_impossible_is_logged(devices: dict[str, EmulatorProcess]) -> None:
    bus = devices["bus"]
    bus.fault("unplug", replug_after_s=0.05)
    bus.fault("replug")  # before or after its time
    (bus.root / "dev" / "ttyACM9").touch()
    bus.fault("unplug", replug_after_s=0.1, name="ttyACM9")
    entry = bus.wait_for(["refused"])
    assert entry["reason"].endswith("dev/ttyACM9: is in use; choose another name")
    bus.fault("replug", name="ttyACM0")
    assert bus.ask("state")["plugged"]


def test_other_files_are_left_alone(tmp_path: Path) -> None:
    mine = tmp_path / "letters.txt"
    mine.write_text("mine")
    message = "letters.txt already exists and is not a socket; name another path"
    with pytest.raises(EmulatorError, match=message):
        EmulatedGamepad(path=mine).start()
    with pytest.raises(EmulatorError, match=message):
        EmulatedLidar(control=mine).start()
    assert mine.read_text() == "mine"
