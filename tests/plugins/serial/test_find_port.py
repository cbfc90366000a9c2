"""``joshua find-port``: the list, and the identity that is written into a configuration."""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

import pytest
from joshua.cli.main import main
from joshua_serial.commands import find_port
from usb_host import plug

CONFIG = """# My robot.
robot {
  actions {
    node { node_name: "leader_arm" node_id: 1 node_type: PYTHON }
    action_type: ACTION_LEADER
    sts3215_config {
      comm {
        serial {
          port: "PORT_L"   # left of the desk
          baudrate: 1000000
        }
      }
      motor_ids: [1]
    }
  }
  actions {
    node { node_name: "follower_arm" node_id: 2 node_type: PYTHON }
    action_type: ACTION_FOLLOWER
    sts3215_config { comm { serial { port: "PORT_R", baudrate: 1000000 } } motor_ids: [1] }
  }
}
"""


def run(root: Path, *words: str) -> int:
    parser = argparse.ArgumentParser()
    find_port.add_arguments(parser)
    return find_port.run(parser.parse_args(words), str(root))


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """A file whose two arms are plugged in at two sockets, L1 and R1."""
    left, right = plug(tmp_path, "ttyACM0", "L1"), plug(tmp_path, "ttyACM1", "R1")
    path = tmp_path / "robot.pbtxt"
    path.write_text(CONFIG.replace("PORT_L", left).replace("PORT_R", right))
    return path


def test_each_adapter_is_named_as_a_file_names_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plug(tmp_path, "ttyACM0", "L1")
    plug(tmp_path, "ttyACM1", "R1")
    assert run(tmp_path, "--no-scan") == 0
    left, right = capsys.readouterr().out.split("\n\n")
    assert left == (
        f"{tmp_path}/dev/ttyACM0  USB Single Serial, driver cdc_acm\n"
        '  serial_number: "L1"\n'
        '  vid_pid: "1a86:55d3"\n'
        f'  port: "{tmp_path}/dev/serial/by-id/usb-Maker_L1-if00"'
    )
    assert 'serial_number: "R1"' in right


def test_the_list_is_there_for_programs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plug(tmp_path, "ttyACM0", "L1", place="1-2.3")
    assert run(tmp_path, "--no-scan", "--format", "json") == 0
    (entry,) = json.loads(capsys.readouterr().out)
    assert (entry["serial_number"], entry["vid_pid"], entry["place"]) == ("L1", "1a86:55d3", "1-2.3")
    assert entry["motors"] is None


def test_without_any_adapter_the_next_steps_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path) == 4
    out = capsys.readouterr().out
    assert out.startswith("no USB serial adapter was found\n")
    assert "switch on the arm's supply" in out


def test_a_port_without_permission_points_to_the_doctor(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = Path(plug(tmp_path, "ttyACM0", "L1"))
    path.chmod(0o000)
    if os.geteuid() == 0:  # root may open every port: ask as somebody else would

        def access(path: str, mode: int) -> bool:
            return bool(os.stat(path).st_mode & mode)

        monkeypatch.setattr("joshua_serial.ports.survey.os.access", access)
    assert run(tmp_path, "--no-scan") == 0
    assert "this user may not open the port; joshua doctor" in capsys.readouterr().out


def test_a_port_that_is_named_and_cannot_be_used_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path, "--port", str(tmp_path / "ttyUSB7")) == 4
    assert "no such serial port" in capsys.readouterr().out


def test_the_program_knows_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["find-port", "--no-scan", "--format", "json"]) in (0, 4)
    assert isinstance(json.loads(capsys.readouterr().out), list)


def test_identities_are_written_and_all_else_stays(
    tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = config.read_text()
    assert run(tmp_path, "--write", str(config)) == 0
    out = capsys.readouterr().out
    assert '+          serial_number: "L1"' in out
    assert out.endswith(f"{config}: written\n")
    after = config.read_text()
    assert '  # left of the desk\n          serial_number: "L1"\n          baudrate: 1000000\n' in after
    assert 'serial { port: "' + f'{tmp_path}/dev/ttyACM1" serial_number: "R1", baudrate' in after
    assert after.replace('\n          serial_number: "L1"', "").replace(' serial_number: "R1"', "") == before
    assert run(tmp_path, "--write", str(config)) == 0
    assert "already names its adapters, so there is nothing to write" in capsys.readouterr().out
    assert config.read_text() == after


def test_the_change_can_be_looked_at_first(
    tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = config.read_bytes()
    assert run(tmp_path, "--write", str(config), "--show-only") == 0
    out = capsys.readouterr().out
    assert '+          serial_number: "L1"' in out
    assert "written" not in out
    assert config.read_bytes() == before


def test_line_ends_and_mode_of_the_file_stay(tmp_path: Path, config: Path) -> None:
    config.write_bytes(config.read_text().replace("\n", "\r\n").encode())
    config.chmod(0o640)
    assert run(tmp_path, "--write", str(config), "--node", "leader_arm") == 0
    assert b'desk\r\n          serial_number: "L1"\r\n' in config.read_bytes()
    assert b"R1" not in config.read_bytes()
    assert config.stat().st_mode & 0o777 == 0o640


def test_a_stale_identity_and_path_are_replaced(tmp_path: Path, config: Path) -> None:
    assert run(tmp_path, "--write", str(config)) == 0
    right = str(tmp_path / "dev/ttyACM1")
    text = config.read_text().replace('"R1"', '"L1"').replace('serial_number: "L1"', 'serial_number: "R1"', 1)
    config.write_text(text)  # the arms were exchanged
    assert run(tmp_path, "--write", str(config), "--node", "leader_arm", "--port", right) == 0
    after = config.read_text()
    assert f'port: "{right}"   # left of the desk\n          serial_number: "R1"' in after


def test_an_included_file_is_changed_where_the_field_stands(tmp_path: Path, config: Path) -> None:
    outer = tmp_path / "outer.pbtxt"
    outer.write_text('include: "robot.pbtxt"\n')
    assert run(tmp_path, "--write", str(outer)) == 0
    assert outer.read_text() == 'include: "robot.pbtxt"\n'
    assert 'serial_number: "L1"' in config.read_text()


def refused(root: Path, config: Path, capsys: pytest.CaptureFixture[str], *words: str, code: int = 2) -> str:
    before = config.read_bytes()
    assert run(root, "--write", str(config), *words) == code
    assert config.read_bytes() == before
    error = capsys.readouterr().err
    assert error.endswith("nothing was written\n")
    return error


def test_an_arm_that_is_not_plugged_in_is_not_guessed(
    tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config.write_text(config.read_text().replace("ttyACM1", "ttyACM7"))
    error = refused(tmp_path, config, capsys)
    assert "follower_arm: " in error
    assert "does not say which of the others to use" in error
    assert "(serial_number L1, vid_pid 1a86:55d3)" in error
    assert "choose one: --node follower_arm --port PATH" in error


def test_two_arms_cannot_share_an_adapter(
    tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config.write_text(config.read_text().replace("ttyACM1", "ttyACM0"))
    assert "follower_arm and leader_arm both name" in refused(tmp_path, config, capsys)


def test_adapters_that_cannot_be_told_apart_are_not_written(
    tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plug(tmp_path, "ttyUSB0", "L1", "10c4:ea60")
    words = ("--node", "leader_arm")
    assert run(tmp_path, "--write", str(config), *words, "--show-only") == 0
    assert '+          serial_number: "L1"\n+          vid_pid: "1a86:55d3"' in capsys.readouterr().out
    plug(tmp_path, "ttyACM2", "L1")
    assert "3 adapters have the serial number L1" in refused(tmp_path, config, capsys, *words)


def test_adapters_without_a_serial_number_are_named_by_product_or_by_socket(
    tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = plug(tmp_path, "ttyUSB0", "", "1a86:7523")
    words = ("--node", "leader_arm", "--port", first)
    assert run(tmp_path, "--write", str(config), *words, "--show-only") == 0
    assert '+          vid_pid: "1a86:7523"' in capsys.readouterr().out
    plug(tmp_path, "ttyUSB1", "", "1a86:7523")
    error = refused(tmp_path, config, capsys, *words)
    assert "2 adapters have no serial number, and the product 1a86:7523" in error
    assert "joshua doctor --udev" in error


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (
            ("--node", "leader"),
            "no node leader with a serial link; nearest: leader_arm. Nodes with one",
        ),
        (("--port", "/dev/ttyACM0"), "several nodes or ports match: give one --port with one --node"),
        (
            ("--node", "leader_arm", "--port", "/dev/null"),
            "/dev/null is not a USB adapter",
        ),
    ],
)
def test_what_is_unclear_is_refused(
    tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], text: str
) -> None:
    assert text in refused(tmp_path, config, capsys, *words)


def test_a_file_that_cannot_be_read_stays_as_it_is(
    tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config.write_text(config.read_text().replace("motor_ids", "motor_idz", 1))
    assert "motor_idz" in refused(tmp_path, config, capsys)


def test_a_file_that_cannot_be_written_is_put_back(
    tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from joshua.tools import EditError
    from joshua_serial.ports import write_command

    def refuse(path: str, values: object) -> None:
        raise EditError("it reads back otherwise")

    monkeypatch.setattr(write_command, "_check", refuse)
    assert "the file was restored: it reads back otherwise" in refused(tmp_path, config, capsys)


def test_without_any_adapter_there_is_nothing_to_write(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "robot.pbtxt"
    config.write_text(CONFIG)
    error = refused(tmp_path, config, capsys, "--node", "leader_arm", code=4)
    assert "leader_arm: PORT_L is not plugged in, nor is any other adapter: plug it in first" in error


def test_the_name_that_a_rule_gives_is_lasting(
    tmp_path: Path, config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = plug(tmp_path, "ttyUSB0", "", "1a86:7523")
    plug(tmp_path, "ttyUSB1", "", "1a86:7523")
    name = tmp_path / "dev/joshua/leader_arm"
    name.parent.mkdir()
    name.symlink_to(first)
    config.write_text(config.read_text().replace(str(tmp_path / "dev/ttyACM0"), str(name)))
    assert run(tmp_path, "--write", str(config), "--node", "leader_arm") == 0
    assert "nothing to write" in capsys.readouterr().out
