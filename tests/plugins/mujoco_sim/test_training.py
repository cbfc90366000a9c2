"""The environment and the reward that a training block chooses: found, checked, made, and learned from."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joshua.plan import ServiceFacts, Severity
from joshua.planner.draft import Draft
from joshua.planner.environments import choose_environment
from joshua.planner.pipeline import check_file, examine
from joshua.planner.request import Purpose, Request
from joshua.plugins.targets import make_environment
from joshua.testing.domain import reserved_domain
from joshua_mujoco_sim.envs import TASKS, make_vector_environment
from joshua_mujoco_sim.plugin import ENVIRONMENTS

REACH = 'environment_id: "joshua/SoArm100Reach-v0"'


def training_file(
    *, environment: str = REACH, reward: str = "", seed: str = "", more: str = "method: METHOD_RL"
) -> str:
    reward_function = f'reward_function: "{reward}"' if reward else ""
    return f"""
general {{ mode: MODE_TRAINING name: "train" id: "train-test" }}
simulation {{ mode: OFFSCREEN model_path: "so_arm100/reach.xml" {seed} }}
ai {{
  training {{
    environment: ENV_SIMULATION
    simulator_backend: BACKEND_MJX
    {more}
    {environment}
    rl_config {{
      algorithm: "PPO" num_envs: 3 total_timesteps: 100 learning_rate: 0.001 gamma: 0.9 batch_size: 8
      {reward_function}
    }}
  }}
}}
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "train.pbtxt"
    path.write_text(text)
    return path


def chosen(folder: Path, text: str):
    """What the file chooses, through the whole road of a validation but the trainer, which is not there."""
    checked = check_file(Request(str(write(folder, text))))
    draft = Draft(checked.loaded, checked.registry, checked.request)
    environment = choose_environment(draft)
    assert not draft.findings
    return environment


def errors(folder: Path, text: str):
    return examine(Request(str(write(folder, text)), purpose=Purpose.VALIDATE)).errors


def test_what_is_offered_is_what_there_is() -> None:
    assert [offer.id for offer in ENVIRONMENTS] == list(TASKS)
    for offer in ENVIRONMENTS:
        task = TASKS[offer.id]
        assert task() == task(offer.rewards[0])
        with pytest.raises(ValueError, match=f"choose {' or '.join(offer.rewards)}$"):
            task("none of them")


def test_block_becomes_environments_with_its_seed_and_reward(tmp_path: Path) -> None:
    text = training_file(reward="reach_sparse", seed="seed: 7")
    facts = ServiceFacts(environment=chosen(tmp_path, text))
    first, second = make_environment(facts), make_environment(facts)
    assert first.num_envs == 3
    observations = []
    for environment in (first, second):
        observation, *_, info = environment.step(np.full((3, 6), 0.5))
        assert list(info["reward_terms"]) == ["reached"]
        observations.append(observation)
    assert np.array_equal(*observations)
    assert not np.array_equal(observations[0][0], observations[0][1])
    other = ServiceFacts(environment=chosen(tmp_path, text.replace("seed: 7", "seed: 8")))
    assert not np.array_equal(make_environment(other).step(np.full((3, 6), 0.5))[0], observations[0])
    assert make_environment(facts, num_envs=1).num_envs == 1


@pytest.mark.parametrize(
    ("environment", "reward", "expected"),
    [
        (REACH, "", ("joshua/SoArm100Reach-v0", "reach")),
        ("", "pick_place_sparse", ("joshua/SoArm100PickPlace-v0", "pick_place_sparse")),
        ("", "forward", ("joshua/Ant-v0", "forward")),
    ],
)
def test_default_reward_and_environment_by_its_reward(
    tmp_path: Path, environment: str, reward: str, expected: tuple[str, str]
) -> None:
    found = chosen(tmp_path, training_file(environment=environment, reward=reward))
    assert (found.environment_id, found.reward_function) == expected
    assert found.seed is None


def test_unknown_environment_is_found_with_the_nearest(tmp_path: Path) -> None:
    (error,) = errors(tmp_path, training_file(environment='environment_id: "joshua/SoArm100Rech-v0"'))
    assert error.code == "environment-unknown"
    assert error.field_path == "ai.training.environment_id"
    assert error.position.line == 9
    assert error.allowed[0] == "joshua/SoArm100Reach-v0"
    assert error.remedy == "Did you mean joshua/SoArm100Reach-v0?"


def test_unknown_reward_is_found_with_the_nearest(tmp_path: Path) -> None:
    (error,) = errors(tmp_path, training_file(reward="reach_spars"))
    assert error.code == "reward-unknown"
    assert error.field_path == "ai.training.rl_config.reward_function"
    assert error.message == "The environment joshua/SoArm100Reach-v0 offers no reward 'reach_spars'."
    assert error.allowed == ("reach_sparse", "reach")
    (error,) = errors(tmp_path, training_file(environment="", reward="foreward"))
    assert error.message == "No environment offers the reward 'foreward'."
    assert error.remedy == "Did you mean forward?"


def test_a_launch_needs_to_know_the_task(tmp_path: Path) -> None:
    path = write(tmp_path, training_file(environment=""))
    found = [d for d in examine(Request(str(path))).diagnostics if d.code == "environment-needed"]
    assert [d.severity for d in found] == [Severity.NOTE]
    launched = examine(Request(str(path), purpose=Purpose.LAUNCH)).errors
    (needed,) = [d for d in launched if d.code == "environment-needed"]
    assert needed.allowed == tuple(TASKS)
    assert needed.remedy == 'Add environment_id: "joshua/SoArm100Reach-v0", or another one.'


def test_plugin_that_offers_the_environment_is_named_where_it_is_missing(tmp_path: Path) -> None:
    path = write(tmp_path, training_file())
    blocked = Request(str(path), purpose=Purpose.LAUNCH, blocked_plugins=("joshua-mujoco-sim",))
    (missing,) = [d for d in examine(blocked).errors if d.field_path == "ai.training.environment_id"]
    assert "joshua-mujoco-sim" in missing.message


@pytest.mark.parametrize("more", ["method: METHOD_IMITATION", "method: METHOD_RL environment: ENV_REAL"])
def test_environment_without_effect_is_said(tmp_path: Path, more: str) -> None:
    text = training_file(more=more)
    if "ENV_REAL" in more:
        text = text.replace("    environment: ENV_SIMULATION\n", "")
    path = write(tmp_path, text)
    notes = [d for d in examine(Request(str(path))).diagnostics if d.code == "block-unused"]
    assert "ai.training.environment_id" in [d.field_path for d in notes]


def test_validation_imports_no_gymnasium(tmp_path: Path) -> None:
    path = write(tmp_path, training_file())
    code = f"""
import sys
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
assert not examine(Request({str(path)!r}, purpose=Purpose.VALIDATE)).errors
print(sorted({{"gymnasium", "mujoco", "numpy"}} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_without_mujoco_4_they_run_one_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    together = make_vector_environment("joshua/Ant-v0", num_envs=2, seed=5)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    apart: Any = make_vector_environment(
        "joshua/Ant-v0", num_envs=2, seed=5, threads=1, autoreset_mode="SameStep", max_episode_steps=1
    )
    assert type(apart).__name__ == "SyncVectorEnv"
    actions = np.full((2, 8), 0.2)
    *_, info = apart.step(actions)
    assert np.array_equal(together.step(actions)[0], np.stack(info["final_obs"]))


BLOCKED = ("--block-plugin", "joshua-mjx-trainer")  # which provides BACKEND_MJX, too

TRAINER = """
from joshua import api
from joshua.plugins import TrainerSpec, hookimpl


@hookimpl
def joshua_specs():
    return [
        TrainerSpec(
            block="training",
            enum_values=("BACKEND_MJX",),
            implementation="acme_trainer:Trainer",
        )
    ]


class Trainer(api.Trainer):
    def configure(self):
        from joshua.plugins.targets import make_environment

        self.environment = make_environment(self.context.spec.facts)

    def activate(self):
        self.context.create_timer(0.05, self.learn)

    def learn(self):
        _, rewards, *_ = self.environment.step(self.environment.action_space.sample() * 0)
        self.context.end_run(f"learned of {len(rewards)} rewards")

    def cleanup(self):
        self.environment.close()
"""


def test_a_trainer_only_asks_for_it(tmp_path: Path) -> None:
    """A third party's trainer in a real run: the file's environment reaches it through the plan."""
    (tmp_path / "acme_trainer.py").write_text(TRAINER)
    info = tmp_path / "acme_trainer-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-trainer\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(textwrap.dedent("[joshua.plugins]\nacme = acme_trainer\n"))
    path = write(tmp_path, training_file(reward="reach_sparse", seed="seed: 7"))
    with reserved_domain() as domain:
        ended = subprocess.run(
            [sys.executable, "-m", "joshua.cli.main", "--config", str(path), *BLOCKED],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain), "PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
            timeout=200,
        )
    assert ended.returncode == 0, ended.stderr
    assert "learned of 3 rewards" in ended.stderr
