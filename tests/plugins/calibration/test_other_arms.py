"""Whose calibration a device holds: entries of the configuration and of the files beside it."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.api.calibration import ArmCalibration
from joshua_calibration.other_arms import fitting_entry

ARM = """
actions {{
  node {{
    node_name: "{name}" node_id: {number} node_type: PYTHON
    publishers {{ data_type: JOINT_STATE topic_name: "/{name}" publish_rate_hz: 50.0 }}
  }}
  action_type: ACTION_LEADER
  sts3215_config {{ comm {{ serial {{ {port} baudrate: 1000000 }} }} motor_ids: [1] }}
}}
"""
ENTRY = 'arms {{ node_name: "{}" motors {{ id: 1 joint_name: "pan" homing_offset: {} range_max: 4095 }} }}\n'


def calibrations(**offsets: int) -> str:
    entries = "".join(ENTRY.format(name, offset) for name, offset in offsets.items())
    return f"calibration {{ {entries} }}\n"


def configuration(
    folder: Path, *, left: str = 'port: "/dev/ttyACM0"', right: str = 'port: "/dev/ttyACM1"'
) -> str:
    arms = ARM.format(name="left", number=1, port=left) + ARM.format(name="right", number=2, port=right)
    file = folder / "my robot.pbtxt"
    file.write_text(f'general {{ id: "rig" }}\nrobot {{ {arms} }}\n' + calibrations(left=11, right=22))
    return str(file)


def holds(offset: int):
    """A device with one value, as a driver compares it."""

    def fits(calibration: ArmCalibration) -> bool:
        return [(motor.id, motor.homing_offset) for motor in calibration.motors] == [(1, offset)]

    return fits


def test_swapped_ports_are_swapped_back_by_the_printed_lines(tmp_path: Path) -> None:
    source = configuration(tmp_path)
    fit = fitting_entry(source, (), "left", holds(22))
    assert fit is not None
    assert fit.cause == "these are the values of right: swap the two ports"
    left, right = "robot.actions[0].sts3215_config", "robot.actions[1].sts3215_config"
    assert fit.remedy == (
        f"Both calibrations are good: keep them. Write into {source}:",
        f'  {left}.comm.serial.port: "/dev/ttyACM1"',
        f'  {right}.comm.serial.port: "/dev/ttyACM0"',
        f"or try it first: joshua --config '{source}' --set '{left}.comm.serial.port=/dev/ttyACM1' "
        f"--set '{right}.comm.serial.port=/dev/ttyACM0'",
    )


def test_the_ports_of_the_command_line_count(tmp_path: Path) -> None:
    source = configuration(tmp_path)
    field = "robot.actions[0].sts3215_config.comm.serial.port"
    fit = fitting_entry(source, (f"{field}=/dev/ttyUSB7",), "right", holds(11))
    assert fit is not None
    assert '  robot.actions[1].sts3215_config.comm.serial.port: "/dev/ttyUSB7"' in fit.remedy


def test_adapters_are_swapped_by_their_identity(tmp_path: Path) -> None:
    source = configuration(tmp_path, left='serial_number: "A"', right='serial_number: "B"')
    fit = fitting_entry(source, (), "left", holds(22))
    assert fit is not None
    assert '  robot.actions[0].sts3215_config.comm.serial.serial_number: "B"' in fit.remedy


def test_ports_that_are_named_differently_are_not_swapped(tmp_path: Path) -> None:
    source = configuration(tmp_path, right='serial_number: "B"')
    fit = fitting_entry(source, (), "left", holds(22))
    assert fit is not None
    assert fit.cause == "these are the values of right"
    assert fit.remedy == ("Connect left, or correct its port. Both calibrations are good: keep them.",)


@pytest.mark.parametrize("name", ["other.pbtxt", "calibration/other.pbtxt"])
def test_files_beside_the_configuration_are_searched(tmp_path: Path, name: str) -> None:
    source = configuration(tmp_path)
    file = tmp_path / name
    file.parent.mkdir(exist_ok=True)
    file.write_text(calibrations(bench=33, left=44))
    (tmp_path / "broken.pbtxt").write_text("calibration { arms { homing_offset")
    elsewhere = fitting_entry(source, (), "left", holds(33))
    assert elsewhere is not None
    assert elsewhere.cause == f"these are the values of bench in {file}"
    assert elsewhere.remedy[0].startswith("Connect left, or correct its port.")
    own = fitting_entry(source, (), "left", holds(44))
    assert own is not None
    assert own.cause == f"these are the values of left in {file}"
    assert own.remedy == (f'Include that file: write include: "{name}" into {source}',)


def test_values_that_nothing_in_reach_has_are_nobodys(tmp_path: Path) -> None:
    source = configuration(tmp_path)
    assert fitting_entry(source, (), "left", holds(55)) is None
    assert fitting_entry(source, (), "left", holds(11)) is None, "its own entry is no other arm"
    assert fitting_entry("", (), "left", holds(22)) is None
