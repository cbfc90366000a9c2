"""``joshua doctor --udev``: rules for the adapters that are plugged in."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.cli.commands import doctor
from joshua.cli.parser import parse
from joshua_serial.doctor.udev import MARK
from usb_host import MakeHost, plug


def run(host: object, *words: str) -> int:
    _, arguments = parse(["doctor", *words])
    return doctor.run(arguments, host)  # type: ignore[arg-type]


def test_an_adapter_gets_a_name_by_its_identity(
    tmp_path: Path, make_host: MakeHost, capsys: pytest.CaptureFixture[str]
) -> None:
    plug(tmp_path, "ttyACM0", "L1")
    assert run(make_host(), "--udev") == 0
    out, err = capsys.readouterr()
    assert out.startswith(MARK)
    assert (
        'SUBSYSTEM=="tty", ATTRS{idVendor}=="1a86", ATTRS{idProduct}=="55d3", ATTRS{serial}=="L1", '
        'SYMLINK+="joshua/adapter_L1", GROUP="dialout", MODE="0660", TAG+="uaccess", '
        'ENV{ID_MM_DEVICE_IGNORE}="1"\n'
    ) in out
    assert "latency_timer" not in out
    assert "save it as /etc/udev/rules.d/72-joshua.rules, then run: sudo udevadm control --reload" in err


def test_equal_adapters_are_told_apart_by_their_socket(
    tmp_path: Path, make_host: MakeHost, capsys: pytest.CaptureFixture[str]
) -> None:
    plug(tmp_path, "ttyUSB0", "", "1a86:7523", place="1-2")
    plug(tmp_path, "ttyUSB1", "", "0403:6014", place="1-3.1", driver="ftdi_sio")
    assert run(make_host(), "--udev") == 0
    out = capsys.readouterr().out
    assert 'ATTRS{idProduct}=="7523", KERNELS=="1-2", SYMLINK+="joshua/adapter_1-2"' in out
    assert 'KERNELS=="1-3.1", SYMLINK+="joshua/adapter_1-3.1"' in out
    assert 'DRIVER=="ftdi_sio", ATTR{latency_timer}="1"' in out


def test_adapters_are_named_like_the_nodes_of_a_file(
    tmp_path: Path, make_host: MakeHost, capsys: pytest.CaptureFixture[str]
) -> None:
    path = plug(tmp_path, "ttyACM0", 'L"1*')
    config = tmp_path / "robot.pbtxt"
    config.write_text(f"""
        robot {{ actions {{
          node {{ node_name: "left arm" node_id: 1 node_type: PYTHON }}
          action_type: ACTION_FOLLOWER
          sts3215_config {{ comm {{ serial {{ port: "{path}" baudrate: 1000000 }} }} motor_ids: [1] }}
        }} }}""")
    assert run(make_host(), "--udev", "--config", str(config)) == 0
    out = capsys.readouterr().out
    assert 'SYMLINK+="joshua/left_arm"' in out
    assert 'ATTRS{serial}=="L?1?"' in out  # nothing of an adapter's text acts as a pattern or ends the rule


def test_rules_are_written_to_a_folder_and_again(
    tmp_path: Path, make_host: MakeHost, capsys: pytest.CaptureFixture[str]
) -> None:
    plug(tmp_path, "ttyACM0", "L1")
    target = tmp_path / "72-joshua.rules"
    assert run(make_host(), "--udev", str(tmp_path)) == 0
    assert f"{target}: written\nnow run: sudo udevadm control --reload" in capsys.readouterr().out
    plug(tmp_path, "ttyACM1", "R1")
    assert run(make_host(), "--udev", str(target)) == 0
    assert "adapter_R1" in target.read_text()


def test_a_file_of_another_program_is_left_alone(
    tmp_path: Path, make_host: MakeHost, capsys: pytest.CaptureFixture[str]
) -> None:
    plug(tmp_path, "ttyACM0", "L1")
    target = tmp_path / "99-mine.rules"
    target.write_text("# mine\n")
    assert run(make_host(), "--udev", str(target)) == 2
    assert "was not written by joshua doctor --udev: choose another file" in capsys.readouterr().err
    assert target.read_text() == "# mine\n"
    assert run(make_host(), "--udev", str(tmp_path / "none/72.rules")) == 2
    assert "joshua doctor --udev | sudo tee /etc/udev/rules.d/72-joshua.rules" in capsys.readouterr().err


def test_without_an_adapter_there_is_nothing_to_name(
    make_host: MakeHost, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(make_host(), "--udev") == 4
    assert "no USB serial adapter is plugged in" in capsys.readouterr().err
