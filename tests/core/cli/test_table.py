"""Commands that plugins bring, by the metadata of their distributions."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from joshua.cli.main import main
from joshua.cli.table import commands_by_distribution, find_command, usable_commands

Adder = Callable[..., None]


@pytest.fixture(autouse=True)
def _from_a_package(monkeypatch: pytest.MonkeyPatch) -> None:
    """The core is installed from a package, so that plugins are named by their distribution."""
    monkeypatch.setattr("joshua.plan.installing.clone", lambda: None)
    monkeypatch.setattr("joshua.plan.installing.origin", lambda *_: "")


@pytest.fixture
def add(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Adder]:
    """Adds a distribution with one command: ``add("acme-rig", "wave", source)``."""
    modules: list[str] = []
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(distribution: str, command: str, source: str) -> None:
        module = f"{distribution.replace('-', '_')}_command"
        modules.append(module)
        (tmp_path / f"{module}.py").write_text(source)
        info = tmp_path / f"{distribution.replace('-', '_')}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[joshua.commands]\n{command} = {module}\n")

    yield write
    for module in modules:
        sys.modules.pop(module, None)


WAVE = """
SUMMARY = "wave with the arm"

def add_arguments(parser):
    parser.add_argument("--times", type=int, default=1)

def run(arguments):
    print("wave", arguments.times)
    return 0
"""


def test_a_command_of_a_plugin_runs(add: Adder, capsys: pytest.CaptureFixture[str]) -> None:
    add("acme-rig", "wave", WAVE)
    assert main(["wave", "--times", "3"]) == 0
    assert capsys.readouterr().out == "wave 3\n"
    assert commands_by_distribution()["acme-rig"] == ["wave"]
    assert "wave" in [command.name for command in usable_commands()]


def test_a_misspelt_command_names_the_one_of_a_plugin(add: Adder, capsys: pytest.CaptureFixture[str]) -> None:
    add("acme-rig", "wave", WAVE)
    with pytest.raises(SystemExit) as caught:
        main(["wavee"])
    assert caught.value.code == 2
    assert "nearest: wave" in capsys.readouterr().err


def test_a_command_of_a_plugin_behind_an_option_is_told_where_it_stands(
    add: Adder, capsys: pytest.CaptureFixture[str]
) -> None:
    add("acme-rig", "wave", WAVE)
    with pytest.raises(SystemExit) as caught:
        main(["--config", "arm.pbtxt", "wave"])
    assert caught.value.code == 2
    assert capsys.readouterr().err == (
        "joshua: error: wave is a command of a plugin and must be the first argument: joshua wave …\n"
        "  see: joshua --help\n"
    )


def test_a_broken_command(add: Adder, capsys: pytest.CaptureFixture[str]) -> None:
    add("acme-rig", "wave", "import nowhere_to_be_found")
    with pytest.raises(SystemExit) as caught:
        main(["wave"])
    assert caught.value.code == 3
    text = capsys.readouterr().err
    assert "the command wave of acme-rig cannot be loaded (ModuleNotFoundError: No module named" in text
    assert "pip install --force-reinstall acme-rig" in text
    assert "wave" not in [command.name for command in usable_commands()]


def test_two_plugins_with_one_command(add: Adder, capsys: pytest.CaptureFixture[str]) -> None:
    add("acme-rig", "wave", WAVE)
    add("other-rig", "wave", WAVE)
    with pytest.raises(SystemExit) as caught:
        main(["wave"])
    assert caught.value.code == 3
    assert "acme-rig and other-rig both bring the command wave. Uninstall one" in capsys.readouterr().err


def test_the_core_keeps_its_own_commands(add: Adder, capsys: pytest.CaptureFixture[str]) -> None:
    add("acme-rig", "plan", "raise SystemExit('this must not be imported')")
    assert main(["plan"]) == 2
    assert "no file given: joshua plan FILE" in capsys.readouterr().err


def test_a_plugin_that_is_not_installed_is_named(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("joshua.cli.table.plugin_commands", list)
    with pytest.raises(SystemExit) as caught:
        main(["find-cameras"])
    assert caught.value.code == 3
    assert capsys.readouterr().err == (
        "joshua: error: find-cameras requires the plugin joshua-camera, which is not installed: "
        "pip install joshua-camera\n"
    )


def test_other_words_are_no_command_of_a_plugin() -> None:
    assert find_command("robot.pbtxt") is None


def test_nothing_is_looked_up_for_options(monkeypatch: pytest.MonkeyPatch) -> None:
    def look_up() -> None:
        raise AssertionError("the metadata were read")

    monkeypatch.setattr("joshua.cli.table.plugin_commands", look_up)
    assert main(["--version"]) == 0
