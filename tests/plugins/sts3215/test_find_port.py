from __future__ import annotations

import argparse
import json
from pathlib import Path

import pytest
from joshua.cli.main import main
from joshua.devices.usb_ports import PortEntry
from joshua_sts3215.commands import find_port


def plug(root: Path, name: str, serial: str) -> None:
    """Lays out what a Linux host shows of one USB serial adapter."""
    usb = root / "sys/devices/usb1" / name
    node = usb / "tty" / name
    node.mkdir(parents=True)
    (node / "device").symlink_to("../..")
    (usb / "idVendor").write_text("1a86\n")
    (usb / "idProduct").write_text("55d3\n")
    (usb / "serial").write_text(f"{serial}\n")
    for folder in ("sys/class/tty", "dev/serial/by-id"):
        (root / folder).mkdir(parents=True, exist_ok=True)
    (root / "sys/class/tty" / name).symlink_to(node)
    (root / "dev" / name).touch()
    (root / "dev/serial/by-id" / f"usb-{serial}-if00").symlink_to(f"../../{name}")


def run(root: Path, *words: str) -> int:
    parser = argparse.ArgumentParser()
    find_port.add_arguments(parser)
    return find_port.run(parser.parse_args(words), str(root))


def test_each_adapter_is_named_as_a_file_names_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plug(tmp_path, "ttyACM0", "L1")
    plug(tmp_path, "ttyACM1", "R1")
    assert run(tmp_path) == 0
    left, right = capsys.readouterr().out.split("\n\n")
    assert left == (
        f"{tmp_path}/dev/ttyACM0\n"
        '  serial_number: "L1"\n'
        '  vid_pid: "1a86:55d3"\n'
        f'  port: "{tmp_path}/dev/serial/by-id/usb-L1-if00"'
    )
    assert 'serial_number: "R1"' in right


def test_the_list_is_there_for_programs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plug(tmp_path, "ttyACM0", "L1")
    assert run(tmp_path, "--format", "json") == 0
    (entry,) = json.loads(capsys.readouterr().out)
    assert (entry["serial_number"], entry["vid_pid"]) == ("L1", "1a86:55d3")


def test_without_any_adapter_the_next_steps_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path) == 4
    out = capsys.readouterr().out
    assert out.startswith("no USB serial adapter was found\n")
    assert "switch on the arm's supply" in out


def test_a_port_without_permission_says_how_to_get_it() -> None:
    assert "no permission: sudo usermod -aG dialout" in find_port.paragraph(PortEntry("/dev/absent"))


def test_the_program_knows_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["find-port", "--format", "json"]) in (0, 4)
    assert isinstance(json.loads(capsys.readouterr().out), list)
