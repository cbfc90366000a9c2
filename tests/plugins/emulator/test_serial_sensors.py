"""Emulated scanners and encoders as processes: their state, their faults, and what they refuse."""

from __future__ import annotations

import math
import os
import random
import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from joshua.plugins.emulator import EmulatedDevice, EmulationError
from joshua.schema import config_pb2
from joshua_emulator import EmulatedEncoder, EmulatedLidar, EmulatorError
from joshua_emulator.serial_sensors import EncoderEmulator, LidarEmulator
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint


@pytest.fixture(scope="module")
def scanner() -> Iterator[EmulatedLidar]:
    with EmulatedLidar("ld19") as process:
        yield process


@pytest.fixture(scope="module")
def encoder() -> Iterator[EmulatedEncoder]:
    with EmulatedEncoder("line") as process:
        yield process


@pytest.mark.parametrize(
    ("kind", "value", "text"),
    [
        (
            "stal",
            None,
            "unknown fault 'stal'; allowed: drop, corrupt, stall, silent, turn_hz, unplug, replug, rate",
        ),
        ("corrupt", 2, "corrupt is 2; allowed: a probability from 0 to 1"),
        ("corrupt", None, "corrupt needs a value, as in corrupt=…: a probability from 0 to 1"),
        ("turn_hz", 500, "turn_hz is 500; allowed: 0 to 50 Hz"),
        ("dirty", 9000, "dirty is 9000; allowed: 1 to 4000 bytes"),
        ("health", 2, "health: ld19 scanners report no health; allowed here: drop, corrupt, stall"),
    ],
)
def test_what_a_scanner_refuses(scanner: EmulatedLidar, kind: str, value: float | None, text: str) -> None:
    with pytest.raises(EmulatorError, match=re.escape(text)):
        scanner.fault(kind, value)


@pytest.mark.parametrize(
    ("kind", "value", "text"),
    [
        (
            "magnet",
            None,
            "unknown fault 'magnet'; allowed: drop, corrupt, stall, silent, freeze, no_magnet, unplug",
        ),
        ("drop", -1, "drop is -1; allowed: a probability from 0 to 1"),
        ("dirty", -5, "dirty is -5; allowed: 1 to 4000 bytes"),
    ],
)
def test_what_an_encoder_refuses(encoder: EmulatedEncoder, kind: str, value: float | None, text: str) -> None:
    with pytest.raises(EmulatorError, match=re.escape(text)):
        encoder.fault(kind, value)


def test_unknown_operations_are_refused(scanner: EmulatedLidar, encoder: EmulatedEncoder) -> None:
    for process in (scanner, encoder):
        with pytest.raises(EmulatorError, match="unknown operation 'dance'; allowed: state, "):
            process.ask("dance")


def test_a_stall_ends_after_its_time(scanner: EmulatedLidar) -> None:
    scanner.fault("stall")
    assert scanner.state()["turn_hz"] == 0
    scanner.ask("clear_faults")
    assert scanner.state()["turn_hz"] == 10
    scanner.fault("stall", 0.2)
    stall = scanner.log("stall")[-1]
    assert scanner.wait_for(["go_on"], since=stall["sequence"])["t_ns"] - stall["t_ns"] >= 0.2e9
    assert scanner.state()["turn_hz"] == 10


def test_the_truth_about_the_shaft(encoder: EmulatedEncoder) -> None:
    state = encoder.ask("state")
    assert encoder.angle_rad(state["t_ns"]) == pytest.approx(state["angle_rad"], abs=1e-6)
    encoder.fault("stall")
    assert encoder.angle_rad(state["t_ns"] + 10**9) == encoder.angle_rad(state["t_ns"] + 2 * 10**9)
    encoder.ask("clear_faults")


def test_a_scanner_sends_at_the_rate_of_the_real_one(scanner: EmulatedLidar) -> None:
    before = scanner.state()
    expected_hz = pytest.approx(375, rel=0.05)  # 4500 measurements a second, 12 in a packet
    for _ in range(15):  # a process that is held up sends the rest later: the longer, the less it matters
        time.sleep(2)
        after = scanner.state()
        rate_hz = (after["packets"] - before["packets"]) / (after["t_ns"] - before["t_ns"]) * 1e9
        if rate_hz == expected_hz:
            break
    assert rate_hz == expected_hz


def test_the_names_are_those_of_a_usb_adapter(scanner: EmulatedLidar) -> None:
    assert os.path.basename(scanner.by_id) == "usb-JOSHUA_Emulated_Laser_Scanner_LIDAR0-if00"
    assert Path(scanner.by_id).resolve() == Path(scanner.port).resolve()


@pytest.mark.parametrize(
    ("model", "baudrate", "found"),
    [
        ("", 115_200, "rplidar_a1"),
        ("", 230_400, "ld19"),
        ("", 460_800, "rplidar_c1"),
        ("", 128_000, "ydlidar_x4"),
        ("lds01", 230_400, "lds01"),
    ],
)
def test_the_scanner_that_stands_for_a_block(tmp_path: Path, model: str, baudrate: int, found: str) -> None:
    block = config_pb2.LidarConfig(model=model)
    block.comm.serial.vid_pid = "10c4:ea60"
    block.comm.serial.baudrate = baudrate
    emulator = LidarEmulator(EmulatedDevice("front", "PERCEPTION_LIDAR", block, tmp_path))
    emulator.start()
    try:
        emulator.amend(block)
        assert not block.comm.serial.vid_pid
        assert block.comm.serial.baudrate == baudrate
        assert emulator._process.state()["model"] == found
        assert Path(block.comm.serial.port).resolve() == Path(emulator.endpoint).resolve()
    finally:
        emulator.close()


def test_a_place_that_takes_no_memory_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    device = EmulatedDevice(
        "front", "PERCEPTION_LIDAR", config_pb2.LidarConfig(), tmp_path / "file" / "front"
    )
    with pytest.raises(EmulationError, match="front, which keeps the memory of the emulated device, cannot"):
        LidarEmulator(device).start()


def test_the_encoders_that_stand_for_a_block(tmp_path: Path) -> None:
    block = config_pb2.EncoderConfig(protocol="amt21", resolution=4096, address=[8, 12])
    block.comm.serial.baudrate = 2_000_000
    emulator = EncoderEmulator(EmulatedDevice("wheels", "PERCEPTION_ENCODER", block, tmp_path))
    emulator.start()
    try:
        state = emulator._process.ask("state")
        assert state["baudrate"] == 2_000_000
        assert abs(state["angle_rad"]) < 3 * math.tau
    finally:
        emulator.close()


@pytest.mark.parametrize("model", ["rplidar_a1", "rplidar_c1", "ydlidar_x4", "lds01"])
def test_noise_from_the_host_does_not_end_a_scanner(model: str) -> None:
    draw = random.Random(1)
    with EmulatedLidar(model) as scanner:
        port = SerialPort(Endpoint(scanner.port), scanner.state()["baudrate"])
        port.open()
        for number in range(200):
            port.send(draw.randbytes(draw.randrange(1, 60)))
            if number % 20 == 0:
                scanner.state()  # what it has not taken yet would fill the line
        port.send(b"b" if model == "lds01" else b"\x00" * 300 + b"\xa5\x60" + b"\xa5\x20")
        deadline_s = time.monotonic() + 60
        while not scanner.state()["scanning"] and time.monotonic() < deadline_s:
            time.sleep(0.02)
        assert scanner.state()["scanning"]
        port.close()
