"""PPO in JAX: learning, stopping, continuing bit for bit. `./test -s mjx` runs these."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from joshua.plan import ChosenEnvironment
from joshua.planner.pipeline import examine
from joshua.planner.request import Request
from joshua.schema import config_pb2 as pb
from joshua.testing.recording_context import RecordingContext
from joshua_mujoco_sim.envs import TASKS
from joshua_mujoco_sim.model_file import model_file
from joshua_ppo_trainer import files
from joshua_ppo_trainer.policy import Policy
from joshua_training.memory import remedied
from joshua_training.run_folder import RunError, RunFolder
from learner_behaviours import LearnerBehaviours, differ

jax = pytest.importorskip("jax", reason="needs JAX: run ./test -s mjx")
jnp = pytest.importorskip("jax.numpy")

from joshua_mjx_trainer import network  # noqa: E402
from joshua_mjx_trainer.environment import KeyDraws, MjxEnvironments, Step, variant_of  # noqa: E402
from joshua_mjx_trainer.learner import Learner  # noqa: E402
from joshua_mjx_trainer.node import MjxTrainer  # noqa: E402
from joshua_mjx_trainer.settings import MjxSettings  # noqa: E402

PRESET = Path(__file__).resolve().parents[3] / "configs" / "training_rl_mjx.pbtxt"

SMALL: dict[str, Any] = {
    "algorithm": "PPO",
    "num_envs": 16,
    "total_timesteps": 1000,
    "learning_rate": 0.003,
    "gamma": 0.9,
    "batch_size": 32,
    "n_steps": 12,
    "n_epochs": 2,
    "hidden_sizes": [16],
}


@pytest.fixture(autouse=True)
def single_precision() -> Any:
    """As in a training; other tests compare with MuJoCo in double precision."""
    jax.config.update("jax_enable_x64", False)
    yield
    jax.config.update("jax_enable_x64", False)


class Points:
    """Environments that compile at once: points on a line, which the action moves to their goals."""

    task = SimpleNamespace(action_size=2, judges_success=True)
    single_observation_space = spaces.Box(-np.inf, np.inf, (3,), np.float32)

    def reset(self, keys: Any) -> Any:
        draws = KeyDraws(keys)
        carry = {"place": draws.uniform(-1.0, 1.0), "left": jnp.full(len(keys), 9, jnp.int32)}
        carry["keys"] = draws.keys
        return carry, self.seen(carry)

    def seen(self, carry: Any) -> Any:
        return jnp.stack([carry["place"], 3.0 + 2.0 * carry["place"], 0.1 * carry["left"]], axis=1)

    def step(self, carry: Any, actions: Any) -> Any:
        place = carry["place"] + 0.3 * jnp.clip(actions[:, 0], -1.0, 1.0)
        moved = {**carry, "place": place, "left": carry["left"] - 1}
        done = jnp.abs(place) < 0.1
        cut = (moved["left"] <= 0) & ~done
        final = self.seen(moved)
        rewards = jnp.abs(carry["place"]) - jnp.abs(place) + done
        fresh, _ = self.reset(carry["keys"])
        over = done | cut
        moved = {k: jnp.where(over.reshape(-1, *(1,) * (v.ndim - 1)), fresh[k], v) for k, v in moved.items()}
        return moved, Step(self.seen(moved), final, rewards, done, cut, done)


class Scripted:
    """Two environments without chance: the first is cut off by step 3, the second ends by step 2."""

    task = Points.task
    single_observation_space = Points.single_observation_space

    def reset(self, keys: Any) -> Any:
        del keys
        carry = {"time": jnp.zeros(2, jnp.int32), "age": jnp.zeros(2, jnp.int32)}
        return carry, self.seen(carry["time"], carry["age"])

    @staticmethod
    def seen(time: Any, age: Any) -> Any:
        return jnp.stack([jnp.sin(2.0 * age), jnp.array([0.5, -0.5]) + age, 0.1 * time], axis=1)

    def step(self, carry: Any, actions: Any) -> Any:
        del actions
        time, age = carry["time"] + 1, carry["age"] + 1
        done, cut = (time == 2) & jnp.array([False, True]), (time == 3) & jnp.array([True, False])
        following = {"time": time, "age": jnp.where(done | cut, 0, age)}
        rewards = 0.5 * time + jnp.array([0.0, 1.0])
        return following, Step(
            self.seen(time, following["age"]), self.seen(time, age), rewards, done, cut, done
        )


def settings(**fields: Any) -> MjxSettings:
    block = pb.Training(environment=pb.ENV_SIMULATION, rl_config=pb.RLConfig(**{**SMALL, **fields}))
    return MjxSettings.from_block(block).suitable("acme/Points-v0")


def learner(
    environments: Any = None, seed: int = 5, asked: Callable[[], bool] = lambda: False, **fields: Any
) -> Learner:
    return Learner(settings(**fields), environments or Points(), seed, asked)


def rows(made: Learner, count: int) -> list[dict[str, float]]:
    found = []
    for _ in range(count):
        row = made.iterate()
        assert row is not None
        found.append({key: value for key, value in row.items() if not key.startswith("rate/")})
    return found


def weights(made: Learner) -> dict[str, Any]:
    return made.snapshot()[0]


class TestMjx(LearnerBehaviours):
    def make(self, asked: Callable[[], bool] = lambda: False, **fields: Any) -> Any:
        return learner(asked=asked, **fields)

    def fill_value(self, made: Any, value: float) -> None:
        made.tree["weights"]["value_net.weight"] = jnp.full((1, 16), value)

    def learned(self, **fields: Any) -> dict[str, Any]:
        made = learner(**{"normalize_observations": False, "normalize_rewards": False, **fields})
        with jax.disable_jit():  # each setting would be compiled anew, for seconds
            rows(made, 1)
        return self.weights(made)


def test_it_learns() -> None:
    made = learner(num_envs=64, n_steps=16, batch_size=128, n_epochs=4)
    first, *_, last = rows(made, 25)
    assert last["episode/success_rate"] > 0.98 > first["episode/success_rate"] + 0.1
    assert last["steps"] == 25 * 64 * 16
    assert last["episode/length"] < 6


def test_an_episode_that_is_cut_off_counts_what_it_would_have_been_worth() -> None:
    """Advantages are sums over the temporal differences up to the end of each episode."""
    steps, gamma, lam = 5, 0.9, 0.8
    plain: dict[str, Any] = {"normalize_observations": False, "normalize_rewards": False}
    made = learner(Scripted(), num_envs=2, n_steps=steps, batch_size=2, gae_lambda=lam, **plain)
    with jax.disable_jit():
        made.prepare()
        tree, samples = made._collected(made.tree, steps)
        batch = made._judged(tree, samples)

    def value(time: int, age: int) -> Any:
        seen = Scripted.seen(jnp.full(2, time), jnp.full(2, age))
        return np.asarray(network.value(made.tree["weights"], seen, made._settings))

    for index, end, terminal in ((0, 3, False), (1, 2, True)):
        ages = [time if time < end else time - end for time in range(steps + 1)]
        values = [value(time, age)[index] for time, age in enumerate(ages)]
        following = values[1:]
        following[end - 1] = 0.0 if terminal else value(end, end)[index]
        rewards = [0.5 * time + index for time in range(1, steps + 1)]
        differences = [r + gamma * f - v for r, f, v in zip(rewards, following, values[:-1], strict=True)]
        stops = [end if time < end else steps for time in range(steps)]
        expected = [
            sum((gamma * lam) ** (k - time) * differences[k] for k in range(time, stops[time]))
            for time in range(steps)
        ]
        assert np.asarray(batch["advantages"]).reshape(steps, 2)[:, index] == pytest.approx(
            expected, rel=1e-4
        )
        targets = np.add(expected, values[:-1])
        assert np.asarray(batch["targets"]).reshape(steps, 2)[:, index] == pytest.approx(targets, rel=1e-4)


def test_it_goes_on_from_a_checkpoint_bit_for_bit(tmp_path: Path) -> None:
    whole = learner()
    expected = rows(whole, 7)
    before = learner()
    rows(before, 4)
    folder = RunFolder.create(tmp_path, "run", {})
    path = folder.save(before.steps, files.as_files(*before.snapshot(), {"algorithm": "PPO"}))
    after = learner(seed=99)
    after.restore(*files.read(path))
    assert rows(after, 3) == expected[4:]
    assert not differ(weights(whole), weights(after))
    assert {file.suffix for file in path.iterdir()} == {".json", ".safetensors"}
    for other in ({"num_envs": 12}, {"hidden_sizes": [8]}):
        with pytest.raises(RunError, match=r"does not fit the file: .*: continue with the num_envs"):
            learner(**other).restore(*files.read(path))


def test_a_full_disk_does_not_hide_why_learning_ended(tmp_path: Path) -> None:
    result = examine(Request(str(PRESET)))
    assert result.plan is not None
    node = MjxTrainer(RecordingContext(result.plan.nodes[0]))
    node._learner, node._folder = learner(), RunFolder(tmp_path / "gone")
    rows(node._learner, 1)
    node._learner.tree["weights"]["value_net.weight"] = jnp.full((1, 16), jnp.inf)
    with pytest.raises(
        RunError, match=r"is not a number after 192 steps: .*cannot be written: .*create it again"
    ):
        node.advance()


def test_memory_that_does_not_suffice_names_the_setting() -> None:
    """The device itself refuses 64 TB, which an environment keeps."""

    class Huge(Points):
        def reset(self, keys: Any) -> Any:
            carry, seen = super().reset(keys)
            return {**carry, "much": jnp.zeros((1 << 44,)) + carry["place"][0]}, seen

    with (
        pytest.raises(RunError, match="the memory is full: halve num_envs, to 8, or n_steps"),
        remedied(settings().halves()),
    ):
        learner(Huge()).iterate()


def test_the_policy_of_a_checkpoint_acts_as_the_one_that_learned() -> None:
    for fields in ({}, {"activation": "elu"}, {"activation": "relu", "normalize_observations": False}):
        made = learner(**fields)
        rows(made, 2)
        policy, training, _ = made.snapshot()
        moments = {key: training[f"normalise.observed.{key}"].tolist() for key in ("mean", "variance")}
        about = {
            "algorithm": "PPO",
            "activation": made._settings.activation,
            "action_low": [-1.0] * 2,
            "action_high": [1.0] * 2,
            "normalisation": moments if made._settings.normalize_observations else None,
        }
        observations = np.random.default_rng(0).normal(size=(9, 3)).astype(np.float32)
        shown = made._shown(observations, made.tree["normalise"]["observed"])
        expected = jnp.clip(network.mean_action(made.tree["weights"], shown, made._settings), -1.0, 1.0)
        assert Policy(about, policy).act(observations) == pytest.approx(np.asarray(expected), abs=1e-5)


def test_an_environment_of_another_kind_is_refused_and_many_take_long_on_a_cpu(
    caplog: pytest.LogCaptureFixture,
) -> None:
    plan = examine(Request(str(PRESET), overrides=("ai.training.rl_config.num_envs=300",))).plan
    assert plan is not None
    node = MjxTrainer(RecordingContext(plan.nodes[0]))
    chosen = ChosenEnvironment("CartPole-v1", "", 300, 0, "gymnasium:make_vec")
    said = (
        "CartPole-v1 is not made of terms, which MuJoCo XLA requires: choose an environment of joshua-mujoco-"
    )
    with pytest.raises(RunError, match=said):
        node.make(chosen, 0)
    if jax.devices()[0].platform == "cpu":
        assert "300 environments take minutes for each update on a CPU: set num_envs to 64" in caplog.text
    node.cleanup()


def test_an_environment_that_varies_nothing_refuses_randomise(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = EnvSpec(
        "acme/Plain-v0",
        entry_point="joshua_mujoco_sim.envs.single:TermEnv",
        kwargs={
            "task": lambda name="reach": replace(TASKS["joshua/SoArm100Reach-v0"](name), randomisation=())
        },
    )
    monkeypatch.setitem(gymnasium.registry, plain.id, plain)
    plan = examine(Request(str(PRESET), overrides=("ai.training.rl_config.randomise=true",))).plan
    assert plan is not None
    node = MjxTrainer(RecordingContext(plan.nodes[0]))
    said = "^acme/Plain-v0 cannot be made with randomise True: randomise=True has no effect: .*; remove it$"
    with pytest.raises(RunError, match=said):
        node.make(ChosenEnvironment(plain.id, "", 4, 0, "joshua_mujoco_sim.envs:make_vector_environment"), 0)
    node.cleanup()


def test_success_is_counted_where_a_task_has_a_goal(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = rows(learner(), 1)[-1]
    assert 0.0 <= counted["episode/success_rate"] <= 1.0
    monkeypatch.setattr(Points, "task", SimpleNamespace(action_size=2, judges_success=False))
    assert "episode/success_rate" not in rows(learner(), 1)[-1]


def test_a_model_that_jax_cannot_simulate_is_refused(tmp_path: Path) -> None:
    task = TASKS["joshua/SoArm100Reach-v0"]()
    packaged = model_file(variant_of(task.model_path))
    spec = mujoco.MjSpec.from_file(str(packaged))
    spec.option.solver = mujoco.mjtSolver.mjSOL_PGS
    spec.meshdir = str((packaged.parent / spec.meshdir).resolve())
    path = tmp_path / "pgs.xml"
    spec.compile()
    path.write_text(spec.to_xml())
    said = (
        rf"MuJoCo XLA cannot simulate {path}: .*PGS.*: simplify the model, or train with simulator_backend: B"
    )
    with pytest.raises(RunError, match=said):
        MjxEnvironments(replace(task, model_path=str(path)))


def test_a_task_with_arrays_of_its_own_is_refused() -> None:
    def prepare(state: Any) -> None:
        state.memory["mark"] = np.zeros((state.count, 1))

    with pytest.raises(RunError, match=r"keeps mark in memory, which MuJoCo XLA does not offer: train with"):
        MjxEnvironments(replace(TASKS["joshua/SoArm100Reach-v0"](), prepare=prepare))
