from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import pytest
from joshua.cli.commands import presets as command
from joshua.cli.presets import preset_names, read_preset, read_presets


def run(*words: str) -> int:
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return command.run(parser.parse_args(words))


def test_the_list_names_every_preset_with_its_mode_summary_and_plugins(capsys: pytest.CaptureFixture[str]):
    assert run() == 0
    out = capsys.readouterr().out
    flat = " ".join(out.split())
    for preset in read_presets():
        assert f"  {preset.name} " in out
        assert preset.summary in flat
    assert out.index("MODE_TELEOPERATE") < out.index("teleop_keyboard") < out.index("MODE_INFERENCE")
    assert "needs joshua-sts3215, joshua-camera" in flat
    assert "joshua new" in out.splitlines()[-1]


@pytest.mark.parametrize("width", [20, 60, 80, 200])
def test_the_list_keeps_to_the_width_of_the_terminal(width: int):
    text = command.listing(read_presets(), width)
    widest = max(len(line) for line in text.splitlines() if "--with" not in line)  # a command stays whole
    names = max(len(name) for name in preset_names())
    assert widest <= max(width, names + 34)


def with_plugins(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    monkeypatch.setattr(command, "is_usable", lambda name: name in names)


def test_each_preset_says_whether_its_plugins_are_there(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(Path(__file__).parents[3])
    with_plugins(monkeypatch, "joshua-sts3215", "joshua-mock")
    names = ("teleop_so_arm100", "test_camera", "test_mock_hardware")
    arms, camera, mock = (read_preset(name) for name in names)
    absent = replace(read_preset("training_rl_isaac"), sections={"Plugins": ("joshua-absent",)})
    assert command.needs(arms) == "needs joshua-sts3215 (installed)"
    assert command.needs(camera) == "needs joshua-camera (cannot run, not installed: joshua-camera)"
    assert command.needs(absent).endswith("(cannot run, not available yet: joshua-absent)")
    assert command.needs(mock) == "needs joshua-mock (installed)"
    out = command.listing([arms, camera, absent, mock], 120)
    assert "2 of 4 presets can run with the plugins that are installed." in out
    assert "install what is missing: ./run --with camera\n" in out
    assert "not available yet: joshua-absent\n" in out


def test_the_plugins_that_are_installed_here_are_found():
    assert command.is_usable("joshua-core")
    assert not command.is_usable("joshua-absent")


def test_an_optional_plugin_is_not_required(monkeypatch: pytest.MonkeyPatch):
    with_plugins(monkeypatch, "joshua-mujoco-sim", "joshua-mock")
    assert read_preset("teleop_so_arm100_camera").required == ("joshua-sts3215", "joshua-camera")
    out = command.listing([read_preset("sim_offscreen")], 120)
    assert "1 of 1 presets can run" in out
    assert "install what is missing" not in out


def test_an_extra_that_is_not_installed_is_said(monkeypatch: pytest.MonkeyPatch):
    with_plugins(monkeypatch, "joshua-ppo-trainer", "joshua-mujoco-sim")
    preset = read_preset("training_rl_ppo")
    assert preset.required == ("joshua-ppo-trainer", "joshua-mujoco-sim")
    monkeypatch.setattr("joshua.plan.installing.has_extra", lambda name, extra: False)
    assert command.needs(preset).endswith("(installed, but not all that they need: see its header)")
    assert "0 of 1 presets can run" in command.listing([preset], 120)
    monkeypatch.setattr("joshua.plan.installing.has_extra", lambda name, extra: extra == "learn")
    assert command.needs(preset).endswith("(installed)")


def test_from_an_index_the_missing_plugins_are_one_command_of_pip(monkeypatch: pytest.MonkeyPatch):
    with_plugins(monkeypatch)
    monkeypatch.setattr("joshua.plan.installing.clone", lambda: None)
    monkeypatch.setattr("joshua.plan.installing.origin", lambda *_: "")
    out = command.listing([read_preset("teleop_keyboard")], 120)
    assert "install what is missing: pip install joshua-sts3215 joshua-teleop-input\n" in out
    monkeypatch.setattr("joshua.plan.installing.origin", lambda *_: None)
    assert "pip install" not in command.listing([read_preset("teleop_keyboard")], 120)


def test_one_preset_is_printed_as_it_is(capsys: pytest.CaptureFixture[str]):
    assert run("test_mock_hardware") == 0
    assert capsys.readouterr().out == read_preset("test_mock_hardware").text


def test_a_misspelt_preset_names_the_nearest(capsys: pytest.CaptureFixture[str]):
    assert run("teleop_so_arm10") == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == (
        "joshua presets: no preset is named 'teleop_so_arm10'\n"
        "  nearest: teleop_so_arm100, teleop_so_arm100_camera, teleop_dual_arm\n"
        "  see: joshua presets\n"
    )


def test_sections_of_the_header_are_read_line_by_line():
    preset = read_preset("teleop_so_arm100_camera")
    assert preset.mode == "TELEOPERATE"
    assert preset.plugins == "joshua-sts3215, joshua-camera, joshua-dataset (optional: records)"
    assert preset.sections["Run"] == ("joshua --config teleop_so_arm100_camera.pbtxt",)
    assert len(preset.sections["Change"]) == 3
    assert read_preset("test_mock_hardware").plugins == "joshua-mock"
