"""``joshua doctor`` on emulated buses."""

from __future__ import annotations

from pathlib import Path

import pytest
from google.protobuf import text_format
from joshua.cli.commands import doctor
from joshua.cli.doctor.host import Host
from joshua.cli.parser import parse
from joshua.devices.calibration import ArmCalibration
from joshua.schema import config_pb2
from joshua_emulator import EmulatedBus
from joshua_serial.port import SerialPort
from joshua_serial.ports import survey
from joshua_serial.usb_ports import Endpoint


def run(emulator: EmulatedBus, *words: str) -> int:
    _, arguments = parse(["doctor", *words])
    return doctor.run(arguments, Host(emulator.root))


@pytest.fixture
def config(tmp_path: Path, arm_emulator: EmulatedBus) -> Path:
    """A calibrated arm on the emulator."""
    path = tmp_path / "robot.pbtxt"
    block = config_pb2.Config()
    block.calibration.arms.append(ArmCalibration.model_validate(arm_emulator.calibration()).to_block("arm"))
    path.write_text(f"""
        general {{ mode: MODE_TEST id: "d" name: "d" }}
        robot {{ actions {{
          node {{ node_name: "arm" node_id: 1 node_type: PYTHON
            publishers {{ data_type: JOINT_STATE topic_name: "/arm" publish_rate_hz: 20 }} }}
          action_type: ACTION_FOLLOWER
          sts3215_config {{
            comm {{ serial {{ port: "{arm_emulator.port}" baudrate: 1000000 }} }}
            motor_ids: [1, 2, 3, 4, 5, 6] position_min: 0 position_max: 4095 velocity: 1000 }}
        }} }}
        {text_format.MessageToString(block)}""")
    return path


def test_a_bus_in_order_is_one_line(arm_emulator: EmulatedBus, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(arm_emulator) == 0
    assert "STS3215 servos 1, 2, 3, 4, 5, 6 at 1000000 bit/s, firmware 3.10" in capsys.readouterr().out


def test_what_motors_say_of_themselves_is_judged(capsys: pytest.CaptureFixture[str]) -> None:
    with EmulatedBus(ids=(1, 2, 3), models=(777, 2825, 777)) as emulator:
        emulator.ask("set", id=1, temperature_c=64)
        emulator.ask("set", id=3, temperature_c=85)
        emulator.ask("set_register", slot=1, name="firmware_minor", value=9)
        emulator.ask("set_register", slot=0, name="firmware_minor", value=8)
        assert run(emulator, "--port", emulator.port) == 4
    out = capsys.readouterr().out
    assert "id 1: 64 °C, at most 70 °C\n         do: let it cool down" in out
    assert "error    motors: " in out
    assert "id 3: 85 °C, at most 70 °C" in out
    assert "id 3: too hot" in out
    assert "id 2: is a STS3250, which this driver does not support" in out
    assert "motors have different firmware versions: 3.8: id 1" in out


def test_the_voltage_and_the_line_speed_are_judged(
    emulator: EmulatedBus, capsys: pytest.CaptureFixture[str]
) -> None:
    emulator.ask("set", volts=3.5)
    emulator.ask("set_register", slot=2, name="baudrate", value=4)
    assert run(emulator) == 4
    out = capsys.readouterr().out
    assert "id 1: 3.5 V, allowed 4.0 to 14.0 V\n         do: use a supply of the motors' voltage" in out
    assert "different line speeds: 1000000 bit/s: ids 1, 2; 115200 bit/s: id 3" in out
    assert "run `joshua motors setup` to set one" in out
    emulator.ask("set", volts=4.3)
    run(emulator)
    assert (
        "4.3 V, allowed 4.0 to 14.0 V\n         do: check the supply: its voltage" in capsys.readouterr().out
    )


def test_a_silent_and_a_busy_port(
    emulator: EmulatedBus, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    emulator.fault("silent")
    assert run(emulator) == 0
    assert (
        "no motor answers at any line speed\n         do: if this adapter belongs to an arm, switch"
        in capsys.readouterr().out
    )
    port = SerialPort(Endpoint(emulator.port), 1_000_000)
    port.open()
    try:
        assert run(emulator) == 4
        assert "the port is in use by " in capsys.readouterr().out
        monkeypatch.setattr(survey, "node_that_holds", lambda processes: f"in use by {list(processes)}")
        assert run(emulator) == 0  # a run uses it
    finally:
        port.close()
    assert "not checked: in use by [" in capsys.readouterr().out


def test_a_calibrated_arm_of_a_file_is_opened_and_left_without_torque(
    arm_emulator: EmulatedBus, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(arm_emulator, "--config", str(config)) == 0
    assert "ok       devices: /arm: replies: shoulder_pan, shoulder_lift" in capsys.readouterr().out
    assert {servo["torque_enable"] for servo in arm_emulator.servos()} == {0}
    assert not arm_emulator.log("write")


def test_a_file_can_be_checked_without_opening_its_devices(
    arm_emulator: EmulatedBus, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(arm_emulator, "--config", str(config), "--no-scan") == 0
    assert "devices: " not in capsys.readouterr().out
    assert arm_emulator.ask("state")["reads"] == 0


def test_missing_motors_and_another_calibration_are_errors(
    arm_emulator: EmulatedBus, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arm_emulator.fault("break_after", 4)
    assert run(arm_emulator, "--config", str(config)) == 4
    out = capsys.readouterr().out
    assert "missing ids: 5, 6" in out
    assert "the chain breaks after id 4" in out
    arm_emulator.ask("clear_faults")
    arm_emulator.ask("set_register", slot=1, name="homing_offset", value=12)
    assert run(arm_emulator, "--config", str(config)) == 4
    out = capsys.readouterr().out
    assert "the calibration does not match these servos" in out
    assert "and 12 in the servo" in out


def test_a_hot_joint_and_a_missing_calibration_are_warnings(
    arm_emulator: EmulatedBus, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arm_emulator.ask("set", id=2, temperature_c=63)
    assert run(arm_emulator, "--config", str(config)) == 0
    assert (
        "warning  devices: /arm shoulder_lift: 63 °C, close to its limit of 70 °C" in capsys.readouterr().out
    )
    text = config.read_text()
    config.write_text(text[: text.index("calibration {")])
    assert run(arm_emulator, "--config", str(config)) == 0
    assert "warning  devices: /arm: is not calibrated, so its torque stays off" in capsys.readouterr().out
