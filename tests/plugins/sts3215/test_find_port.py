"""``joshua find-port`` on emulated buses."""

from __future__ import annotations

import argparse
import json

import pytest
from joshua.cli.commands import find_port
from joshua.devices.serial_port import SerialPort
from joshua.devices.usb_ports import Endpoint
from joshua_emulator import EmulatedBus


def run(emulator: EmulatedBus, *words: str) -> int:
    parser = argparse.ArgumentParser()
    find_port.add_arguments(parser)
    return find_port.run(parser.parse_args(words), str(emulator.root))


def test_the_motors_of_each_adapter_are_listed(
    arm_emulator: EmulatedBus, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(arm_emulator) == 0
    out = capsys.readouterr().out
    assert 'serial_number: "ARM1"' in out
    assert "STS3215 servos at 1000000 bit/s: ids 1, 2, 3, 4, 5, 6 (12.0 V)" in out
    assert run(arm_emulator, "--format", "json") == 0
    (port,) = json.loads(capsys.readouterr().out)
    assert [motor["motor_id"] for motor in port["motors"]] == [1, 2, 3, 4, 5, 6]
    assert port["motors"][0]["block"] == "sts3215_config"


def test_what_is_wrong_on_a_bus_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    with EmulatedBus(ids=(1, 2, 3), models=(777, 2825, 777)) as emulator:
        emulator.ask("set_register", slot=2, name="baudrate", value=4)
        emulator.fault("overload", 1)
        assert run(emulator, "--port", emulator.port) == 0
    out = capsys.readouterr().out
    assert "at 1000000 bit/s: ids 1, 2 (12.0 V)\n    id 1: overloaded\n    id 2: is a STS3250, which" in out
    assert "at 115200 bit/s: id 3 (12.0 V)" in out
    assert "motors of one bus need one line speed and one family: joshua motors setup" in out


def test_two_motors_of_one_id_and_an_empty_bus(capsys: pytest.CaptureFixture[str]) -> None:
    with EmulatedBus(ids=(1,)) as emulator:
        emulator.fault("duplicate", 1)
        assert run(emulator) == 0
        assert "id 1: several motors answer: connect one alone" in capsys.readouterr().out
        emulator.fault("silent")
        assert run(emulator) == 0
    assert "no motor answers" in capsys.readouterr().out


def test_a_port_that_another_program_has_is_named(
    emulator: EmulatedBus, capsys: pytest.CaptureFixture[str]
) -> None:
    port = SerialPort(Endpoint(emulator.port), 1_000_000)
    port.open()
    try:
        assert run(emulator, "--port", emulator.port) == 4
    finally:
        port.close()
    assert "the port is in use by " in capsys.readouterr().out
