"""``joshua models``."""

from __future__ import annotations

import json

from joshua.cli.main import main


def test_lists_every_model(capsys) -> None:
    assert main(["models"]) == 0
    text = capsys.readouterr().out
    assert "so_arm100/scene.xml" in text
    assert "for accelerators: ant/ant_mjx.xml" in text


def test_shows_a_model(capsys) -> None:
    assert main(["models", "so_arm100/scene.xml", "--format", "json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["actuators"][-1] == "gripper"
    assert facts["cameras"] == ["top", "front", "wrist", "overview"]
    assert facts["joints"][0] == {
        "name": "shoulder_pan",
        "type": "hinge",
        "unit": "rad",
        "range": [-2.2, 2.2],
    }


def test_unknown_model_exits_with_2_and_the_nearest_name(capsys) -> None:
    assert main(["models", "so_arm100/scen.xml"]) == 2
    assert "nearest: so_arm100/scene.xml" in capsys.readouterr().err
