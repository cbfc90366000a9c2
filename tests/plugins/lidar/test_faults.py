"""What goes wrong with scanners, and what the user is told."""

from __future__ import annotations

import errno
import itertools
import os
import re
import threading
import time
from collections.abc import Callable

import pytest
from eventually import eventually
from joshua.devices.context import SensorContext
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua.guardian.silence import AwakeClock
from joshua.node.errors import Cancelled
from joshua.plan import SensorFacts
from joshua_emulator import EmulatedLidar
from joshua_lidar import lidar as lidar_module
from joshua_lidar import requests
from joshua_lidar.lidar import SerialLidar
from joshua_serial.errors import PortBusy, PortNotFound
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint

Start = Callable[..., EmulatedLidar]
Make = Callable[..., SerialLidar]


def refusal(lidar: SerialLidar, kind: type[DeviceError] = DeviceError) -> str:
    with pytest.raises(kind) as caught:
        lidar.connect()
    assert not lidar.connected
    return str(caught.value)


def loss(lidar: SerialLidar, timeout_s: float = 60.0) -> str:
    deadline_s = time.monotonic() + timeout_s
    while time.monotonic() < deadline_s:
        try:
            lidar.read(0.2)
        except DeviceDisconnected as error:
            return str(error)
    raise AssertionError("the loss was not noticed")


def test_no_such_port(lidar_at: Make) -> None:
    text = refusal(lidar_at("/dev/ttyUSB_none", "ld19"), PortNotFound)
    assert "/dev/ttyUSB_none: no such serial port" in text


def test_a_port_in_use(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("ld19")
    first = lidar_at(emulator.port, "ld19")
    first.connect()
    text = refusal(lidar_at(emulator.port, "ld19"), PortBusy)
    assert f"(process {os.getpid()}, this one)" in text


@pytest.mark.parametrize(
    ("there", "asked"),
    [
        ("rplidar_a1", 460_800),
        ("ld19", 115_200),
        ("ydlidar_x4", 115_200),
        ("rplidar_c1", 115_200),
        ("lds01", 128_000),
    ],
)
def test_the_wrong_line_speed(emulator_of: Start, lidar_at: Make, there: str, asked: int) -> None:
    emulator = emulator_of(there)
    text = refusal(lidar_at(emulator.port, "", asked))
    right = emulator.state()["baudrate"]
    assert f"does not answer at {asked} bit/s" in text
    assert text.endswith(f"does at {right}: set baudrate: {right}")


def test_another_model_than_the_file_says(emulator_of: Start, lidar_at: Make) -> None:
    text = refusal(lidar_at(emulator_of("ydlidar_x2").port, "rplidar_a1"))
    assert 'is a YDLIDAR X2, but the file has model: "rplidar_a1": set model: "ydlidar_x2"' in text
    text = refusal(lidar_at(emulator_of("lds01").port, "ld19"))
    assert 'is an LDS-01, but the file has model: "ld19"' in text
    text = refusal(lidar_at(emulator_of("ld19").port, "ydlidar_x4"))
    assert 'an LD19 does at 230400: set baudrate: 230400 and model: "ld19"' in text


def test_an_answer_that_is_too_short_is_none() -> None:
    device, line = os.openpty()
    port = SerialPort(Endpoint(os.ttyname(line)), 115_200)
    port.open()

    def answer() -> None:
        os.read(device, 2)
        os.write(device, b"\xa5\x5a\x02\x00\x00\x00\x04\x18\x01")

    scanner = threading.Thread(target=answer)
    scanner.start()
    assert requests.ask(port, requests.request(requests.GET_INFO), requests.INFO_ANSWER) is None
    scanner.join()
    port.close()
    os.close(device)
    os.close(line)


def test_nothing_at_the_port(emulator_of: Start, lidar_at: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    apply_speed = SerialPort._apply_speed

    def apply(port: SerialPort, baudrate: int) -> None:
        if baudrate == 128_000:  # an adapter that cannot run at every line speed
            raise OSError(errno.EINVAL, "Invalid argument")
        apply_speed(port, baudrate)

    monkeypatch.setattr(SerialPort, "_apply_speed", apply)
    emulator = emulator_of("ld19", fault=["silent"])
    text = refusal(lidar_at(emulator.port, "ld19"))
    assert "no laser scanner answers at any line speed: check that it has power" in text


@pytest.mark.parametrize(("model", "fault"), [("", "silent"), ("rplidar_a1", "stall"), ("ld19", "silent")])
def test_a_run_that_ends_is_not_kept_waiting(
    emulator_of: Start, lidar_at: Make, model: str, fault: str
) -> None:
    emulator = emulator_of(model or "rplidar_a1", fault=[fault])
    lidar = lidar_at(emulator.port, model)
    asked = itertools.count()
    lidar.context = SensorContext(SensorFacts(), stopping=lambda: next(asked) > 5)
    with pytest.raises(Cancelled):
        lidar.connect()
    assert not lidar.connected
    if model == "rplidar_a1":
        assert not emulator.state()["motor"]


def test_something_else_at_the_port(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("ld19", fault=["rate=57600"])
    text = refusal(lidar_at(emulator.port, "", 230_400))
    assert "sends data, but no known laser scanner sends such data at any line speed" in text


def test_a_motor_that_stands_still_from_the_start(
    emulator_of: Start, lidar_at: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lidar_module, "FIRST_SCAN_S", 2.0)
    emulator = emulator_of("rplidar_a1", fault=["stall"])
    text = refusal(lidar_at(emulator.port, "rplidar_a1"))
    assert "the RPLIDAR A1 measures, but it does not turn: free its rotor" in text
    eventually(lambda: not emulator.state()["motor"], "the stop of the motor")


@pytest.mark.parametrize("model", ["rplidar_a1", "ld19", "ydlidar_x4"])
def test_a_motor_that_stalls(emulator_of: Start, lidar_at: Make, model: str) -> None:
    emulator = emulator_of(model)
    lidar = lidar_at(emulator.port, model)
    lidar.connect()
    emulator.fault("stall")
    text = loss(lidar)
    assert "measures, but it does not turn: free its rotor and its belt, and check its power" in text


def test_a_scanner_that_falls_silent(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("lds01")
    lidar = lidar_at(emulator.port, "lds01")
    lidar.connect()
    emulator.fault("stall")  # this one sends only while it turns
    assert "the LDS-01 has sent nothing for 2 s: check that its rotor turns" in loss(lidar)


def test_a_machine_that_gives_nobody_its_time_is_no_silence(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("ld19")
    lidar = lidar_at(emulator.port, "ld19")
    lidar.connect()
    emulator.fault("silent")
    lidar.read(0.1)
    held_up_s = 0.0
    lidar._awake = AwakeClock(lambda: time.monotonic() + held_up_s)
    lidar._byte_s = lidar._packet_s = lidar._turn_s = lidar._awake.now_s()
    held_up_s = 30.0  # the scanner has said nothing meanwhile, for its process was held up, too
    lidar.read(0.1)
    emulator.ask("clear_faults")
    assert lidar.read(30.0) is not None


def test_a_line_too_noisy_to_trust(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("ld19")
    lidar = lidar_at(emulator.port, "ld19")
    lidar.connect()
    emulator.fault("corrupt", 0.02)
    text = loss(lidar)
    assert re.search(r"no valid packet of the LD19 for 2\.5 s \(\d+ damaged sections\)", text)


def test_unplug_and_replug(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("rplidar_a1")
    lidar = lidar_at(emulator.by_id, "rplidar_a1")
    lidar.connect()
    emulator.fault("unplug")
    assert "the adapter is gone" in loss(lidar)
    lidar.disconnect()
    assert "no such serial port" in refusal(lidar)
    emulator.fault("replug")
    lidar.connect()
    assert lidar.read(30.0) is not None


def test_a_protection_stop_is_ended_by_a_reset(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("rplidar_a1", fault=["health=2"])
    lidar = lidar_at(emulator.port, "rplidar_a1")
    lidar.connect()
    assert lidar.read(30.0) is not None


def test_a_warning_of_the_scanner_is_passed_on(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("rplidar_a1", fault=["health=1"])
    lidar = lidar_at(emulator.port, "rplidar_a1")
    lidar.connect()
    (text,) = lidar.warnings
    assert "the RPLIDAR A1 warns of an imminent failure (code 0x8001): clean its window" in text


def test_a_wait_for_the_first_scan_is_ended_by_the_stop(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("ld19", fault=["stall"])
    lidar = lidar_at(emulator.port, "ld19")
    lidar.cancel()
    assert "was closed while opening" in refusal(lidar)


def test_firmware_that_knows_no_express_scan(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("rplidar_a1", fault=["old_firmware"])
    text = refusal(lidar_at(emulator.port, "rplidar_a1"))
    assert 'does not start its express scan: firmware before 1.17 needs scan_mode: "standard"' in text
    eventually(lambda: not emulator.state()["motor"], "the stop of the motor")
    lidar = lidar_at(emulator.port, "rplidar_a1", scan_mode="standard")
    lidar.connect()
    assert lidar.read(30.0) is not None
