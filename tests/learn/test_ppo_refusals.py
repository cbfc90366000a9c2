"""PPO: environments that it cannot use are named with what to do."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from joshua.plan import ServiceFacts
from joshua.planner.pipeline import examine
from joshua.planner.request import Request
from joshua.testing.recording_context import RecordingContext
from joshua_ppo_trainer.node import PpoTrainer
from joshua_training.run_folder import RunError
from trainings import write_training


def in_turn(environment_id: str, *, num_envs: int, **_options: Any) -> Any:
    """Environments of a third party, which step one after the other."""
    return gymnasium.vector.SyncVectorEnv([lambda: gymnasium.make("CartPole-v1")] * num_envs)


@pytest.mark.parametrize("own", [False, True])
def test_environments_that_step_in_turn_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own: bool
) -> None:
    """Those of a third party, and JOSHUA's own without MuJoCo 4."""
    plan = examine(Request(str(write_training(tmp_path)))).plan
    assert plan is not None
    spec = plan.nodes[0]
    if own:
        found = importlib.util.find_spec
        monkeypatch.setattr(
            "importlib.util.find_spec", lambda name: None if name == "mujoco.batch" else found(name)
        )
    else:
        facts = spec.facts_as(ServiceFacts)
        assert facts.environment is not None
        chosen = replace(facts.environment, make=f"{__name__}:in_turn")
        spec = spec.model_copy(update={"facts": replace(facts, environment=chosen)})
    node = PpoTrainer(RecordingContext(spec))
    with pytest.raises(RunError, match=r"one environment after the other here; .* install MuJoCo 4"):
        node.configure()
    node.cleanup()
