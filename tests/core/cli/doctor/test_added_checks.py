"""Checks that a plugin adds to ``joshua doctor``, by the metadata of its distribution."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from joshua.cli.commands import doctor
from joshua.cli.parser import parse
from usb_host import MakeHost

Adder = Callable[[str], None]
PART = """
from joshua.cli.doctor.result import DoctorResult, Level

def look(host):
    yield DoctorResult(Level.WARNING, "acme", "daemon", f"runs for {host.user}", "stop it")

def touch(host, arguments):
    yield DoctorResult(Level.OK, "acme", "gripper", f"answers at {arguments.acme_speed}")

def add_arguments(parser):
    parser.add_argument("--acme-speed", default="9600")
    parser.add_argument("--acme-end", action="store_true")

def begin(arguments, host):
    return 7 if arguments.acme_end else None

CHECKS = (look,)
DEVICE_CHECKS = (touch,)
"""


@pytest.fixture
def add(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Adder]:
    """Adds a distribution whose module of that source is a part of the doctor."""
    folder = tmp_path / "site"
    info = folder / "acme_rig-1.0.dist-info"
    info.mkdir(parents=True)
    monkeypatch.syspath_prepend(str(folder))

    def write(source: str) -> None:
        (folder / "acme_rig_doctor.py").write_text(source)
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-rig\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text("[joshua.doctor]\nacme = acme_rig_doctor\n")

    yield write
    sys.modules.pop("acme_rig_doctor", None)


def run(host: object, *words: str) -> int:
    _, arguments = parse(["doctor", *words])
    return doctor.run(arguments, host)  # type: ignore[arg-type]


def test_a_plugin_adds_checks_and_options(
    add: Adder, make_host: MakeHost, capsys: pytest.CaptureFixture[str]
) -> None:
    add(PART)
    assert run(make_host(), "--acme-speed", "115200") == 0
    out = capsys.readouterr().out
    assert "warning  acme: daemon: runs for ada\n         do: stop it" in out
    assert "ok       acme: gripper: answers at 115200" in out
    assert run(make_host(), "--no-scan") == 0
    out = capsys.readouterr().out
    assert "acme: daemon" in out
    assert "acme: gripper" not in out
    assert run(make_host(), "--acme-end") == 7
    assert capsys.readouterr().out == ""


def test_checks_that_cannot_be_loaded_are_a_finding(
    add: Adder, make_host: MakeHost, capsys: pytest.CaptureFixture[str]
) -> None:
    add("import nowhere_to_be_found")
    assert run(make_host(), "--no-scan") == 3
    out = capsys.readouterr().out
    assert "error    software: acme-rig: its checks cannot be loaded (ModuleNotFoundError" in out
    assert "do: run `pip install --force-reinstall acme-rig`" in out


def test_an_option_of_a_plugin_that_is_not_installed_names_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("joshua.plan.installing.clone", lambda: None)
    monkeypatch.setattr("joshua.plan.installing.origin", lambda *_: "")
    monkeypatch.setattr("joshua.cli.doctor.checks.metadata.entry_points", lambda group: ())
    with pytest.raises(SystemExit, match="3"):
        parse(["doctor", "--udev=rules"])
    assert (
        "doctor --udev requires the plugin joshua-serial, which is not installed: pip install joshua-serial"
        in capsys.readouterr().err
    )
    with pytest.raises(SystemExit, match="2"):
        parse(["doctor", "--udve"])
