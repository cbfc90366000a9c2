"""``joshua find-port`` on emulated buses."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from joshua_emulator import EmulatedBus
from joshua_serial.commands import find_port
from joshua_serial.port import SerialPort
from joshua_serial.ports import unplug
from joshua_serial.usb_ports import Endpoint

Hand = Callable[..., None]


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
    assert "motors of one bus need one line speed and one family: run joshua motors setup" in out


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


@pytest.fixture
def two_arms(tmp_path: Path) -> Iterator[tuple[EmulatedBus, EmulatedBus]]:
    """Two adapters of one machine."""
    with (
        EmulatedBus(ids=(1,), root=tmp_path, identity="LEFT", control=tmp_path / "left.sock") as left,
        EmulatedBus(
            ids=(2,), root=tmp_path, identity="RIGHT", name="ttyACM1", control=tmp_path / "right.sock"
        ) as right,
    ):
        yield left, right


@pytest.fixture
def hand(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """A person who does what the program asks for, one thing after each sentence of it."""

    def obey(*actions: Callable[[], None]) -> None:
        waiting = list(actions)

        def say(text: str) -> None:
            usual(text)
            if waiting:
                waiting.pop(0)()

        monkeypatch.setattr(unplug, "_say", say)

    usual = unplug._say
    return obey


def test_an_adapter_is_found_by_pulling_its_plug(
    two_arms: tuple[EmulatedBus, EmulatedBus], hand: Hand, capsys: pytest.CaptureFixture[str]
) -> None:
    left, right = two_arms
    hand(lambda: right.fault("unplug"), lambda: right.fault("replug", name="ttyACM5"))
    assert run(left, "--unplug") == 0
    out, err = capsys.readouterr()
    assert "unplug one adapter (2 are plugged in)" in err
    assert "ttyACM1 (serial_number RIGHT, vid_pid 1a86:55d3). Plug it back in" in err
    assert f"{left.root}/dev/ttyACM5\n" in out
    assert 'serial_number: "RIGHT"' in out
    assert "STS3215 servos at 1000000 bit/s: id 2" in out
    assert "LEFT" not in out


def test_an_adapter_that_was_pulled_is_written_for_its_node(
    two_arms: tuple[EmulatedBus, EmulatedBus],
    hand: Hand,
    tmp_path: Path,
) -> None:
    left, right = two_arms
    config = tmp_path / "robot.pbtxt"
    config.write_text("""robot { actions {
  node { node_name: "arm" node_id: 1 node_type: PYTHON }
  action_type: ACTION_FOLLOWER
  sts3215_config { comm { serial { port: "/dev/ttyACM9" baudrate: 1000000 } } motor_ids: [2] }
} }
""")
    hand(lambda: right.fault("unplug"), lambda: right.fault("replug"))
    assert run(left, "--unplug", "--write", str(config), "--node", "arm") == 0
    assert f'port: "{right.port}" serial_number: "RIGHT" baudrate' in config.read_text()


def test_pulling_nothing_or_everything_is_said(
    two_arms: tuple[EmulatedBus, EmulatedBus],
    hand: Hand,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    left, right = two_arms
    monkeypatch.setattr("joshua_serial.ports.unplug.find_by_unplugging.__defaults__", (0.5,))
    assert run(left, "--unplug") == 4
    assert "no adapter was unplugged within 0.5 s" in capsys.readouterr().err

    def pull_the_hub() -> None:
        left.fault("unplug")
        right.fault("unplug")

    hand(pull_the_hub)
    assert run(left, "--unplug") == 4
    assert "disconnected together: unplug one adapter, not a hub" in capsys.readouterr().err
    assert run(left, "--unplug") == 4
    assert "no USB serial adapter is plugged in" in capsys.readouterr().err
