from __future__ import annotations

import argparse

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
    widest = max(len(line) for line in text.splitlines())
    names = max(len(name) for name in preset_names())
    assert widest <= max(width, names + 34)


def test_a_preset_says_which_of_its_plugins_are_not_installed(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("importlib.metadata.distributions", lambda name: ["it"] * (name == "joshua-sts3215"))
    camera, teleop = read_preset("teleop_so_arm100_camera"), read_preset("teleop_so_arm100")
    assert command.needs(camera).endswith("(not installed: joshua-camera, joshua-dataset)")
    assert command.needs(teleop) == "needs joshua-sts3215 (installed)"
    assert command.needs(read_preset("test_mock_hardware")) == "needs no plugin"


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
    assert preset.plugins == "joshua-sts3215, joshua-camera, joshua-dataset (optional: will record)"
    assert preset.sections["Run"] == ("joshua --config teleop_so_arm100_camera.pbtxt",)
    assert len(preset.sections["Change"]) == 3
    assert read_preset("test_mock_hardware").plugins == ""
