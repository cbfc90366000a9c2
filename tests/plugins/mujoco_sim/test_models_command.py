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


def test_prints_what_can_be_driven_and_a_block_for_it(tmp_path, capsys) -> None:
    path = tmp_path / "leg.xml"
    path.write_text(
        "<mujoco><worldbody><body name='shank'><joint name='knee' range='-60 60'/><geom size='.1'/></body>"
        "</worldbody><actuator><motor name='m' joint='knee'/><adhesion name='foot' body='shank' "
        "ctrlrange='0 1'/></actuator></mujoco>"
    )
    assert main(["models", str(path)]) == 0
    text = capsys.readouterr().out
    assert "  knee  -1.047 to +1.047 rad: motor in a position loop" in text
    assert "also named m" in text
    assert "foot is an adhesion, which attracts bodies and moves no joint" in text
    assert 'sim_config {\n  actuators: [\n    "knee"\n  ]' in text


def test_unknown_model_exits_with_2_and_the_nearest_name(capsys) -> None:
    assert main(["models", "so_arm100/scen.xml"]) == 2
    assert "nearest: so_arm100/scene.xml" in capsys.readouterr().err
