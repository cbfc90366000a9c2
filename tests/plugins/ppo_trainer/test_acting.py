"""A trained policy as a model of a robot: the shipped one reaches; other files are refused with a remedy."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joshua.api import JointSpace, ModelError, Observation, RefusedError
from joshua.testing import check_model
from joshua.tools import check, plan
from joshua_mujoco_sim.envs import make_environment
from joshua_ppo_trainer.acting import Goal, PpoModel
from joshua_ppo_trainer.acting_settings import PpoPolicySettings
from joshua_ppo_trainer.shipped import REACH

PRESET = Path(__file__).parents[3] / "configs/inference_ppo_policy.pbtxt"
NAMES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
JOINTS = JointSpace(NAMES, np.full(6, -3.0), np.full(6, 3.0))
PERIOD_NS = 40_000_000


def made(folder: Path | None = None, goal_m: tuple[float, ...] = (0.1, -0.2, 0.15)) -> PpoModel:
    return PpoModel(PpoPolicySettings(weights=str(folder or ""), goal_m=goal_m, rate_hz=25.0), JOINTS)


def seen(position_rad: Any, step: int = 0) -> Observation:
    values = {"observation.state": np.asarray(position_rad, np.float32)}
    return Observation(10**18 + step * PERIOD_NS, values)


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    return Path(shutil.copytree(REACH, tmp_path / "policy"))


def test_the_model_keeps_the_contract() -> None:
    check_model(made, observe=lambda: seen(np.zeros(6)))


def test_the_shipped_policy_reaches_places_that_it_is_told_and_stays() -> None:
    robot = make_environment("joshua/SoArm100Reach-v0", action_mode="absolute").unwrapped
    robot.reset(seed=3)
    model = made()
    model.load()
    model.reset()
    for index, goal in enumerate(((0.1, -0.2, 0.15), (-0.1, -0.22, 0.1))):
        assert model.goal(Goal(*goal)) == f"the goal is {goal[0]:g}, {goal[1]:g}, {goal[2]:g} m"
        away_m = []
        for step in range(150):  # 6 s
            actions = model.act(seen(robot.state.qpos[0, :6], 150 * index + step))
            assert actions.shape == (1, 6)
            robot.step(actions[0].astype(np.float32))
            away_m.append(np.linalg.norm(robot.state.site("gripper")[0] - goal))
        assert min(away_m) < 0.01, "reached"
        assert max(away_m[-25:]) < 0.03, "and stayed for a second"
    with pytest.raises(RefusedError, match="farther than 1 m"):
        model.goal(Goal(0.0, -2.0, 0.0))
    robot.close()
    model.close()


def test_it_sees_and_does_what_it_saw_and_did_in_training() -> None:
    """The same numbers as in the environment where its joints move, speeds by the difference of two."""
    robot = make_environment("joshua/SoArm100Reach-v0").unwrapped
    robot.reset(seed=1)
    goal = tuple(robot.state.mocap_pos[0, 0])
    model = made(goal_m=goal)
    model.load()
    model.reset()
    before = robot.state.qpos[0].copy()
    robot.state.ctrl[0] = before  # where a robot is that nobody has commanded yet
    model.act(seen(before))
    environment = model._environment
    shown, *_ = robot.step(environment.state.action[0])
    speed = (robot.state.qpos[0] - before) / 0.04
    given = environment.observe_robot(robot.state.qpos[0], speed, np.array(goal))
    same = np.r_[0:6, 12:30]  # all but speeds, which differ within a step
    np.testing.assert_allclose(given[same], shown[same], atol=2e-2)
    robot.close()
    model.close()


def test_the_preset_is_planned_without_its_libraries() -> None:
    result = plan(PRESET)
    assert result.errors == []
    assert result.plan is not None
    (policy,) = (node for node in result.plan.nodes if node.name == "policy")
    assert tuple(joint.name for joint in policy.facts.joints) == NAMES
    assert "torch" not in sys.modules


@pytest.mark.parametrize(
    ("change", "said", "remedy"),
    [
        ({}, "contains no policy of joshua-ppo-trainer: it has no policy.json", "Name the folder of a run"),
        ({"policy.json": "{"}, "does not describe a policy", "Copy the checkpoint again"),
        ({"policy.json": '{"features": {}}'}, "does not describe a policy", "Copy the checkpoint again"),
        (
            {"policy.json": '{"features": {"action": {}}, "environment": "joshua/Ant-v0"}'},
            "has neither policy.safetensors nor policy.onnx",
            "Copy the checkpoint again",
        ),
        (
            {
                "policy.json": '{"features": {"action": {}, "observation.cube": {}}, "environment": "a/b"}',
                "policy.onnx": "",
            },
            "The policy of a/b observes observation.cube, which a robot does not measure",
            "Name a policy of joshua/SoArm100Reach-v0",
        ),
    ],
)
def test_a_folder_that_is_none_is_refused(
    tmp_path: Path, change: dict[str, str], said: str, remedy: str
) -> None:
    (tmp_path / "policy").mkdir()
    for name, content in change.items():
        (tmp_path / "policy" / name).write_text(content)
    text = PRESET.read_text().replace(
        "plugin_config {", 'pretrained_model_name_or_path: "policy" plugin_config {'
    )
    (tmp_path / "robot.pbtxt").write_text(text)
    (finding,) = check(tmp_path / "robot.pbtxt").errors
    assert said in finding.message
    assert finding.remedy.startswith(remedy)


def test_a_place_has_three_numbers(tmp_path: Path) -> None:
    (tmp_path / "robot.pbtxt").write_text(PRESET.read_text().replace("[0.1, -0.2, 0.15]", "[0.1, -0.2]"))
    (finding,) = check(tmp_path / "robot.pbtxt").errors
    assert finding.message == "goal_m has 2 numbers, but a position has 3."
    assert finding.field_path.endswith("goal_m")


def test_torn_weights_and_another_environment_say_what_to_do(copy: Path) -> None:
    weights = copy / "policy.safetensors"
    weights.write_bytes(weights.read_bytes()[:100])
    with pytest.raises(
        ModelError, match=r"contains no policy of joshua-ppo-trainer: .* Copy the checkpoint again"
    ):
        made(copy).load()
    shutil.copy(REACH / "policy.safetensors", weights)
    about = json.loads((copy / "policy.json").read_text()) | {"environment": "joshua/Unknown-v0"}
    (copy / "policy.json").write_text(json.dumps(about))
    with pytest.raises(ModelError, match=r"joshua/Unknown-v0, in which .* cannot be made: no environment"):
        made(copy).load()
    weights.unlink()
    (copy / "policy.onnx").write_bytes(b"no network")
    with pytest.raises(ModelError, match=r"policy\.onnx cannot be loaded: .* Export the policy again"):
        made(copy).load()


def test_the_newest_checkpoint_of_a_run_is_taken(tmp_path: Path) -> None:
    for step in (100, 2000):
        shutil.copytree(REACH, tmp_path / "checkpoints" / f"step_{step:012d}")
    (tmp_path / "run.json").write_text("{}")
    assert made(tmp_path).settings.folder.name == "step_000000002000"
