"""``joshua doctor`` as a command: form, order and exit codes."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from joshua.cli.commands import doctor
from joshua.cli.doctor.result import DoctorResult, Level, exit_code, lines, summary
from joshua.cli.exit_codes import ExitCode
from joshua.cli.parser import parse
from joshua.supervisor.tables import Screen
from usb_host import MakeHost, plug


def run(host: object, *words: str) -> int:
    _, arguments = parse(["doctor", *words])
    return doctor.run(arguments, host)  # type: ignore[arg-type]


def test_an_error_ends_with_the_code_of_its_kind(
    tmp_path: Path, make_host: MakeHost, capsys: pytest.CaptureFixture[str]
) -> None:
    os.chmod(plug(tmp_path, "ttyACM0", "L1"), 0o600)
    assert run(make_host(), "--no-scan") == 4
    out = capsys.readouterr().out
    assert f"error    permissions: {tmp_path}/dev/ttyACM0: -rw-------, group" in out
    assert "\n         do: install the rules" in out
    assert out.splitlines()[-1].startswith("1 error, ")


def test_the_findings_are_there_for_programs(make_host: MakeHost, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(make_host(), "--no-scan", "--format", "json") == 0
    found = json.loads(capsys.readouterr().out)
    assert {"level", "check", "subject", "message", "remedy", "code"} == set(found[0])
    assert {"software", "permissions"} <= {item["check"] for item in found}


def test_the_errors_of_a_file_are_findings(
    tmp_path: Path, make_host: MakeHost, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "robot.pbtxt"
    config.write_text("general { mode: MODE_TETS }\n")
    assert run(make_host(), "--config", str(config)) == 2
    assert "error    configuration: general.mode: " in capsys.readouterr().out


def test_what_is_in_the_way_first_decides_the_exit_code() -> None:
    def result(level: Level, code: ExitCode) -> DoctorResult:
        return DoctorResult(level, "c", "s", "first\nsecond", code=code)

    hardware = result(Level.ERROR, ExitCode.HARDWARE)
    assert exit_code([result(Level.WARNING, ExitCode.INVALID)]) == 0
    assert exit_code([hardware, result(Level.ERROR, ExitCode.NOT_INSTALLED)]) == 3
    assert exit_code([hardware, result(Level.ERROR, ExitCode.INVALID)]) == 2
    assert lines(hardware) == ["error    c: s: first", "           second"]
    assert lines(hardware, Screen(20, colour=True)) == [
        "\x1b[31merror  \x1b[0m  c: s: first",
        "           second",
    ]
    assert lines(result(Level.OK, ExitCode.OK), Screen(15)) == [
        "ok       c: s:",
        "           first",
        "           second",
    ]
    assert summary([hardware, hardware]) == "2 errors"


def test_a_command_is_wrapped_only_where_a_shell_reads_on() -> None:
    remedy = (
        'run `echo "ada - memlock unlimited" | sudo tee -a /etc/security/limits.d/joshua.conf`, then log in'
    )
    found = lines(DoctorResult(Level.NOTE, "c", "s", "found", remedy), Screen(80))
    assert found[1:] == [
        '         do: run `echo "ada - memlock unlimited" |',
        "           sudo tee -a /etc/security/limits.d/joshua.conf`, then log in",
    ]
    assert lines(DoctorResult(Level.NOTE, "c", "s", "found", remedy))[1:] == [f"         do: {remedy}"]
