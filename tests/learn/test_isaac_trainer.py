"""The trainer of Isaac Lab without Isaac Lab: its terms on tensors, its learner by rsl_rl, its process."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import joshua_ppo_trainer
import numpy as np
import pytest
import torch
from joshua.schema import config_pb2 as pb
from joshua_isaac_trainer.channel import Channel
from joshua_isaac_trainer.learner import Learner
from joshua_isaac_trainer.networks import policy_facts
from joshua_isaac_trainer.settings import IsaacSettings
from joshua_isaac_trainer.tasks import TensorTask
from joshua_isaac_trainer.tensors import TensorArrays
from joshua_isaac_trainer.worker import _kept_batch, learn, out_of_memory
from joshua_mujoco_sim.envs import make_vector_environment
from joshua_mujoco_sim.envs.state import SingleState
from joshua_ppo_trainer.policy import Policy
from joshua_training.run_folder import RunError, RunFolder
from learner_behaviours import LearnerBehaviours
from rsl_rl.env import VecEnv
from safetensors.numpy import load_file
from tensordict import TensorDict

REACH, PICK = "joshua/SoArm100Reach-v0", "joshua/SoArm100PickPlace-v0"
torch.set_num_threads(1)


class MujocoReadings:
    """What MuJoCo shows of one simulation, twice, as Isaac Lab shows it of its copies."""

    def __init__(self, state: SingleState, arrays: TensorArrays) -> None:
        self._state, self._arrays = state, arrays

    def _twice(self, values: Any) -> torch.Tensor:
        return self._arrays.asarray(np.array(values)).expand(2, -1).clone()

    def joints(self) -> tuple[torch.Tensor, torch.Tensor]:
        return self._twice(self._state.qpos[0, :6]), self._twice(self._state.qvel[0, :6])

    def body(self, name: str) -> tuple[torch.Tensor, torch.Tensor]:
        body = self._state.data.body(name)
        return self._twice(body.xpos), self._twice(body.xquat)

    def speed(self, name: str) -> torch.Tensor:
        first = int(self._state.model.joint(name).dofadr[0])
        return self._twice(self._state.qvel[0, first : first + 6])


@pytest.mark.parametrize(
    ("environment", "reward"),
    [(REACH, "reach"), (REACH, "reach_sparse"), (PICK, "pick_place"), (PICK, "pick_place_sparse")],
)
def test_terms_on_tensors_equal_those_with_numpy(environment: str, reward: str) -> None:
    arrays = TensorArrays(dtype=torch.float64)
    task = TensorTask(environment, reward)
    numpy_state: Any = task.evaluator._state
    evaluator = task.evaluator
    state = task.state(MujocoReadings(numpy_state, arrays), 2, arrays)
    generator = np.random.default_rng(3)
    evaluator.reset(np.array([0]), [generator])
    state.ctrl[:] = arrays.asarray(numpy_state.ctrl)
    state.mocap_pos[:] = arrays.asarray(numpy_state.mocap_pos)
    successes = 0
    for step in range(60):
        numpy_state.forward(np.array([0]))
        state.mocap_pos[:] = arrays.asarray(numpy_state.mocap_pos)
        potentials = task.potentials(state)
        evaluator.potentials.update(
            {name: np.array(value) for name, value in evaluator.potentials_of(numpy_state).items()}
        )
        action = generator.uniform(-1.3, 1.3, 6)
        evaluator.act(action[None])
        task.act(state, torch.from_numpy(np.stack([action, action])))
        np.testing.assert_allclose(state.ctrl[1].numpy(), numpy_state.ctrl[0], atol=1e-9)
        numpy_state.step(task.task.frame_skip)
        if step % 20 == 19:
            _almost_done(numpy_state, environment, generator)
            numpy_state.forward(np.array([0]))
            state.mocap_pos[:] = arrays.asarray(numpy_state.mocap_pos)
        seen = torch.cat([task.observe(state, term.name) for term in task.task.observations], dim=1)
        np.testing.assert_allclose(seen[1].numpy(), evaluator.observation()[0], atol=2e-6)
        _, terms = evaluator.reward()
        for name, weight in task.weights.items():
            value = weight * task.reward(state, name, potentials)
            np.testing.assert_allclose(value[1].item(), terms[name][0], atol=1e-6)
        _, success, reasons = evaluator.terminated()
        for name, reason in reasons.items():
            assert bool(task.ended(state, name)[1]) == bool(reason[0]), (step, name)
        successes += bool(success[0])
    assert successes > 0


def _almost_done(state: Any, environment: str, generator: np.random.Generator) -> None:
    if environment == REACH:
        state.mocap_pos[0, 0] = state.site("gripper")[0] + generator.uniform(-0.004, 0.004, 3)
    else:
        state.qpos[0, 6:9] = [*state.mocap_pos[0, 0, :2], 0.0126]
        state.qpos[0, 9:13] = (1, 0, 0, 0)
        state.qvel[0, 6:] = 0.0


def test_starts_are_those_of_the_task() -> None:
    arrays = TensorArrays()
    task = TensorTask(PICK)
    start = task.begin(500, arrays, torch.Generator().manual_seed(1))
    home = task.model.key("home").qpos
    assert float((start.qpos[:, :6] - arrays.asarray(home[:6])).abs().max()) <= 0.05 + 1e-6
    cube, goal = start.qpos[:, 6:9], start.mocap_pos[:, 0]
    for places in (cube, goal):
        radius = torch.hypot(places[:, 0], places[:, 1] + 0.045)
        assert float(radius.min()) >= 0.19 - 1e-5
        assert float(radius.max()) <= 0.27 + 1e-5
    apart = torch.hypot(cube[:, 0] - goal[:, 0], cube[:, 1] - goal[:, 1])
    assert float(apart.min()) >= 0.07 - 1e-6
    np.testing.assert_allclose(start.qpos[:, 9:13].norm(dim=1).numpy(), 1.0, atol=1e-6)
    assert len({round(float(x), 5) for x in cube[:, 0]}) > 400
    again = task.begin(500, arrays, torch.Generator().manual_seed(1))
    assert torch.equal(again.qpos, start.qpos)
    np.testing.assert_allclose(task.first_goals(start)[0].numpy(), task.model.key("home").ctrl, atol=1e-6)


class MujocoVecEnv(VecEnv):  # type: ignore[misc]
    """Environments of MuJoCo in the form in which Isaac Lab gives its own to rsl_rl."""

    def __init__(self, count: int, environment: str = REACH) -> None:
        self._environment: Any = make_vector_environment(
            environment, num_envs=count, seed=5, autoreset_mode="SameStep"
        )
        self.num_envs, self.num_actions, self.max_episode_length = count, 6, 75
        self.device = torch.device("cpu")
        self.episode_length_buf = torch.zeros(count, dtype=torch.long)
        self.cfg: dict[str, Any] = {}
        self.judges_success = True
        self._seen, _ = self._environment.reset(seed=5)

    def _dict(self) -> TensorDict:
        return TensorDict({"policy": torch.from_numpy(np.array(self._seen))}, batch_size=[self.num_envs])

    def get_observations(self) -> TensorDict:
        return self._dict()

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        done = self._environment.advance(actions.numpy())
        self._seen = done.observations
        over = done.terminated | done.truncated
        extras = {"time_outs": torch.from_numpy(done.truncated)}
        if self.judges_success:
            extras["success"] = torch.from_numpy(done.success)
        return self._dict(), torch.from_numpy(done.rewards).float(), torch.from_numpy(over).long(), extras


SMALL: dict[str, Any] = {
    "algorithm": "PPO",
    "num_envs": 4,
    "total_timesteps": 1000,
    "learning_rate": 0.003,
    "gamma": 0.9,
    "batch_size": 16,
    "n_steps": 8,
    "n_epochs": 2,
    "hidden_sizes": [16, 16],
}


def settings(**fields: Any) -> IsaacSettings:
    block = pb.Training(environment=pb.ENV_SIMULATION, rl_config=pb.RLConfig(**{**SMALL, **fields}))
    return IsaacSettings.from_block(block)


def learner(asked: Callable[[], bool] = lambda: False, **fields: Any) -> Learner:
    made = settings(**fields)
    return Learner(made, MujocoVecEnv(made.num_envs), "cpu", 2, asked)


def about(made: IsaacSettings) -> dict[str, Any]:
    return policy_facts(REACH, TensorTask(REACH).evaluator, 25.0, made.activation)


class TestIsaac(LearnerBehaviours):
    def make(self, asked: Callable[[], bool] = lambda: False, **fields: Any) -> Any:
        return learner(asked, **fields)

    def weights(self, made: Any) -> dict[str, Any]:
        return {name: value.clone() for name, value in made._algorithm.policy.state_dict().items()}

    def fill_value(self, made: Any, value: float) -> None:
        made._algorithm.policy.critic[0].weight.data.fill_(value)


@pytest.mark.parametrize("fields", [{}, {"normalize_observations": True, "activation": "tanh"}])
def test_the_policy_runs_without_pytorch_as_it_learned(fields: dict[str, Any], tmp_path: Path) -> None:
    made = learner(**fields)
    for _ in range(3):
        row = made.iterate()
    assert row is not None
    assert {"steps", "rate/steps_per_s", "train/surrogate_loss", "train/value_function_loss"} <= row.keys()
    folder = RunFolder.create(tmp_path, "run", {}).save(made.steps, made.files(about(settings(**fields))))
    policy = Policy.load(folder)
    seen = torch.randn(20, 30)
    with torch.inference_mode():
        expected = made._algorithm.policy.act_inference(TensorDict({"policy": seen}, batch_size=[20]))
    np.testing.assert_allclose(policy.act(seen.numpy()), np.clip(expected.numpy(), -1, 1), atol=2e-6)
    described = json.loads((folder / "policy.json").read_text())
    shipped = json.loads((Path(joshua_ppo_trainer.__file__).parent / "reach" / "policy.json").read_text())
    for key in (
        "features",
        "observation_offset",
        "observation_scale",
        "action_low",
        "rate_hz",
        "environment",
    ):
        assert described[key] == shipped[key]


def test_a_learner_continues_with_its_weights_and_optimiser(tmp_path: Path) -> None:
    fields: dict[str, Any] = {"normalize_observations": True, "normalize_rewards": True}
    before = learner(**fields)
    for _ in range(3):
        before.iterate()
    folder = RunFolder.create(tmp_path, "run", {}).save(before.steps, before.files(about(settings())))
    after = learner(**fields)
    after.restore(folder)
    assert after.steps == before.steps == 96
    again = after.files(about(settings()))
    for name in ("training.safetensors", "policy.safetensors", "state.json"):
        assert again[name] == (folder / name).read_bytes()
    other = learner(normalize_observations=True, normalize_rewards=True, hidden_sizes=[8])
    with pytest.raises(RunError, match="does not fit the network of this file"):
        other.restore(folder)
    torn = folder / "training.safetensors"
    torn.write_bytes(torn.read_bytes()[:-9])
    with pytest.raises(RunError, match=r"cannot be used: training.safetensors is truncated or damaged"):
        after.restore(folder)
    (folder / "state.json").unlink()
    with pytest.raises(RunError, match="cannot be used"):
        after.restore(folder)


def test_success_is_counted_where_a_task_has_a_goal() -> None:
    made = settings(n_steps=80)  # longer than an episode
    for judges in (True, False):
        environment = MujocoVecEnv(made.num_envs)
        environment.judges_success = judges
        row = Learner(made, environment, "cpu", 2, lambda: False).iterate()
        assert row is not None
        assert "episode/return" in row
        assert ("episode/success_rate" in row) == judges


def test_reaching_is_learned() -> None:
    made = learner(
        num_envs=64,
        n_steps=32,
        n_epochs=8,
        batch_size=512,
        gamma=0.95,
        learning_rate=0.001,
        hidden_sizes=[64, 64],
        activation="tanh",
        total_timesteps=160_000,
    )
    row: dict[str, float] = {"episode/success_rate": 0.0}
    while made.steps < 160_000 and row.get("episode/success_rate", 0.0) < 0.9:
        following = made.iterate()
        assert following is not None
        row = following
    print(f"success {row['episode/success_rate']:.2f} after {made.steps} steps")
    assert row["episode/success_rate"] >= 0.9


@pytest.fixture
def process(tmp_path: Path) -> Iterator[Channel]:
    """The loop of the process of Isaac Sim on a thread, with environments of MuJoCo."""
    mine, other = socket.socketpair()
    made = settings()
    job = {
        "settings": made.model_dump(mode="json"),
        "device": "cpu",
        "seed": 1,
        "environment_id": REACH,
        "checkpoint": "",
        "run": str(tmp_path),
    }
    thread = threading.Thread(target=learn, args=(Channel(other), job, MujocoVecEnv(4), TensorTask(REACH)))
    thread.start()
    channel = Channel(mine)
    yield channel
    channel.close()
    thread.join(30)
    assert not thread.is_alive()


def test_the_process_answers_each_request_once(process: Channel, tmp_path: Path) -> None:
    assert process.receive(60) == {"ready": True, "steps": 0}
    process.send({"do": "advance"})
    answer = process.receive(60)
    assert answer is not None
    assert answer["steps"] == 32
    assert answer["row"]["steps"] == 32.0
    process.send({"do": "save", "folder": str(tmp_path)})
    assert process.receive(60) == {"saved": True}
    assert Policy.load(tmp_path).about["environment"] == REACH
    process.send({"do": "save", "folder": str(tmp_path / "absent")})
    refused = process.receive(60)
    assert refused is not None
    assert refused["refused"] == "No such file or directory"
    process.send({"do": "advance"})
    process.send({"do": "pause"})
    answer = process.receive(60)
    assert answer is not None
    assert answer["steps"] in (32, 64)
    process.send({"do": "advance"})
    answer = process.receive(60)
    assert answer is not None
    assert answer["row"] is not None


def test_a_loss_that_is_no_number_leaves_the_batch(tmp_path: Path) -> None:
    made = learner()
    made.iterate()
    made._algorithm.policy.critic[0].weight.data.fill_(1e30)
    with pytest.raises(RunError):
        made.iterate()
    said = _kept_batch(made, tmp_path)
    assert said == f"the batch and the weights are in {tmp_path / 'diverged.safetensors'}"
    kept = load_file(tmp_path / "diverged.safetensors")
    assert kept["observations"].shape == (32, 30)
    assert not np.isfinite(kept["weights.critic.0.weight"]).all()
    assert "cannot be written: No such file or directory: create it again" in _kept_batch(
        made, tmp_path / "absent"
    )


def test_a_full_memory_names_the_setting_that_halves_it() -> None:
    said = out_of_memory({"settings": {"num_envs": 4096}})
    assert "halve num_envs, to 2048" in said
