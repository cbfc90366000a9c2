"""What settings models say beside what the check has said already."""

from __future__ import annotations

from pathlib import Path

from joshua.config import load
from joshua.config.checks.taint import one_of_each
from joshua.plan import Diagnostic, Severity

TEXT = """
robot { actions { spike_motor_config {
  comm { serial { port: "/dev/ttyACM0" } }
  port_names: "A"
} } }
"""
BLOCK = "robot.actions[0].spike_motor_config"


def said(path: str, code: str = "invalid-setting", severity: Severity = Severity.ERROR) -> Diagnostic:
    return Diagnostic(code, severity, f"{code} at {path}.", field_path=path)


def kept(tmp_path: Path, known: list[Diagnostic], *paths: str) -> list[str]:
    file = tmp_path / "robot.pbtxt"
    file.write_text(TEXT)
    found = one_of_each(known, [said(path) for path in paths], load(file).positions)
    return [item.field_path for item in found if item.code == "invalid-setting"]


def test_a_field_of_the_block_that_should_stand_there_is_an_echo(tmp_path: Path) -> None:
    unfit = said(f"{BLOCK}.comm.serial", "link-unfit")
    paths = (f"{BLOCK}.comm.ble.device_name", f"{BLOCK}.comm", f"{BLOCK}.port_names")
    assert kept(tmp_path, [unfit], *paths) == [f"{BLOCK}.port_names"]


def test_a_range_and_a_rule_of_the_plugin_are_two_things(tmp_path: Path) -> None:
    path = f"{BLOCK}.comm.serial.port"
    assert kept(tmp_path, [said(path, "out-of-range")], path) == [path]
    assert kept(tmp_path, [said(path, "wrong-type")], path) == []


def test_only_errors_and_only_settings_count(tmp_path: Path) -> None:
    path = f"{BLOCK}.port_names"
    assert kept(tmp_path, [said(path, "field-unused", Severity.NOTE)], path) == [path]
    other = said(path, "plugin-missing")
    assert (
        one_of_each([said(path, "wrong-type")], [other], load(tmp_path / "robot.pbtxt").positions)[1] is other
    )
