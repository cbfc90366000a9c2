"""The environments of PPO, as the file describes them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from gymnasium.envs.registration import EnvSpec
from joshua.planner.pipeline import examine
from joshua.planner.request import Request
from joshua.testing.recording_context import RecordingContext
from joshua_mujoco_sim.envs.tasks import reach
from joshua_ppo_trainer.node import PpoTrainer
from joshua_training.run_folder import RunError
from trainings import REACH, write_training


def trainer(folder: Path, environment: str = REACH, **fields: Any) -> PpoTrainer:
    """The node of a file, not configured."""
    path = write_training(folder, **fields)
    path.write_text(path.read_text().replace(REACH, environment))
    result = examine(Request(str(path)))
    assert result.plan is not None, result.errors
    return PpoTrainer(RecordingContext(result.plan.nodes[0]))


@pytest.mark.parametrize("threads", [1, 2])
def test_the_physics_has_the_threads_of_the_file(tmp_path: Path, threads: int) -> None:
    node = trainer(tmp_path, physics_threads=threads)
    node.configure()
    assert node._environment.state.batch.nthread == threads
    node.cleanup()


def test_what_an_environment_refuses_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = EnvSpec(
        "acme/Plain-v0",
        vector_entry_point="joshua_mujoco_sim.envs.vector:TermVectorEnv",
        kwargs={"task": lambda name="reach": replace(reach(name), randomisation=())},
    )
    monkeypatch.setitem(gymnasium.registry, plain.id, plain)
    node = trainer(tmp_path, randomise="true")
    for name, said in (
        ("acme/Plain-v0", "randomise True: randomise=True has no effect: .* remove it: change what"),
        ("CartPole-v1", "got an unexpected keyword argument"),
    ):
        chosen = node.facts.environment
        assert chosen is not None
        options = "threads 0, autoreset_mode SameStep, "
        with pytest.raises(RunError, match=f"^{name} cannot be made with {options}.*{said}"):
            node.make(replace(chosen, environment_id=name), 0)


@pytest.mark.parametrize(("environment", "is_shown"), [(REACH, True), ("joshua/Ant-v0", False)])
def test_success_is_shown_where_a_task_has_a_goal(tmp_path: Path, environment: str, is_shown: bool) -> None:
    node = trainer(tmp_path, environment)
    node.configure()
    node._learner.vec_env.episodes.append((7.5, 20, False))
    row = node._learner.metrics()
    assert ("episode/success_rate" in row) == is_shown
    assert node._shown(row) == ("success 0.00, return 7.5" if is_shown else "return 7.5")
    node.cleanup()
