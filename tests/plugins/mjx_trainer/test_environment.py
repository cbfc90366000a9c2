"""Environments on MuJoCo XLA, and whole runs of the trainer. `./test -s mjx` runs these."""

from __future__ import annotations

import json
import os
import random
import signal
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joshua.api import JointSpace, Observation
from joshua.features import STATE
from joshua.testing.domain import reserved_domain
from joshua_mujoco_sim.catalog import find_packaged
from joshua_mujoco_sim.envs import TASKS, TermEnv, make_environment
from joshua_mujoco_sim.envs.single import make_task
from joshua_ppo_trainer.acting import PpoModel
from joshua_ppo_trainer.acting_settings import PpoPolicySettings
from joshua_ppo_trainer.policy import Policy
from killed_trainings import curve, killed_while_learning, newest_checkpoint, same
from mjx_trainings import start

jax = pytest.importorskip("jax", reason="needs JAX: run ./test -s mjx")
jnp = pytest.importorskip("jax.numpy")

from joshua_mjx_trainer.environment import MjxEnvironments, variant_of  # noqa: E402


@pytest.fixture(autouse=True)
def single_precision() -> Any:
    """As in a training; other tests compare with MuJoCo in double precision."""
    jax.config.update("jax_enable_x64", False)
    yield
    jax.config.update("jax_enable_x64", False)


@pytest.mark.parametrize(
    ("name", "steps", "tolerance"),
    [("joshua/SoArm100PickPlace-v0", 4, 1e-5), ("joshua/Ant-v0", 24, 1e-3)],
)
def test_environments_are_those_of_the_processor(
    tmp_path: Path, name: str, steps: int, tolerance: float
) -> None:
    """The same starts and actions give the same observations, rewards and ends as with NumPy, in float64.

    The ant lands on its feet and walks, with a round friction cone: MuJoCo XLA turns the pyramid of a steep
    capsule on the floor otherwise than MuJoCo, see ``ant_mjx.xml``.
    """
    jax.config.update("jax_enable_x64", True)
    task = make_task(TASKS[name], "", None, False)
    if task.forces:
        task = replace(task, model_path=str(with_round_cone(tmp_path)))
    many = MjxEnvironments(task)
    carry, observations = jax.jit(many.reset)(jax.random.split(jax.random.PRNGKey(1), 2))
    step = jax.jit(many.step)
    single = TermEnv(lambda: replace(task, model_path=variant_of(task.model_path), frame_skip=many.substeps))
    single.reset(seed=0)
    state, evaluator = single.state, single._evaluator
    state.qpos[0], state.qvel[0] = np.asarray(carry["qpos"][0]), np.asarray(carry["qvel"][0])
    state.mocap_pos[0] = np.asarray(carry["mocap_pos"][0])
    state.forward(np.zeros(1, np.int64))
    for potential, values in evaluator.potentials_of(state).items():
        evaluator.potentials[potential][:] = values
        assert np.asarray(carry["potentials"][potential][0]) == pytest.approx(values[0], abs=1e-9)
    assert np.asarray(observations[0]) == pytest.approx(evaluator.observation()[0], abs=1e-6)
    chance, forces = np.random.default_rng(2), 0.0
    for _ in range(steps):
        actions = chance.uniform(-1.0, 1.0, (2, task.action_size))
        carry, done = step(carry, actions)
        expected, reward, terminated, _, _ = single.step(actions[0])
        assert np.asarray(done.observations[0]) == pytest.approx(expected, abs=tolerance)
        assert float(done.rewards[0]) == pytest.approx(reward, abs=10 * tolerance)
        assert bool(done.terminated[0]) == terminated
        forces = max(forces, float(np.abs(np.asarray(carry["contact_forces"][0])).max()))
    assert not task.forces or forces > 10.0, "the feet touch the floor"
    assert many.metadata["render_fps"] == single.metadata["render_fps"]


def with_round_cone(folder: Path) -> Path:
    """A copy of the ant's variant for accelerators with an elliptic friction cone."""
    found = find_packaged("ant/ant_mjx.xml")
    assert found is not None
    text = found.read_text()
    assert text.count('<option timestep="0.01"') == 1
    path = folder / "ant_round.xml"
    path.write_text(
        text.replace('<option timestep="0.01"', '<option timestep="0.01" cone="elliptic"').replace(
            'file="ant_body.xml"', f'file="{found.parent / "ant_body.xml"}"'
        )
    )
    return path


def test_starts_depend_on_their_own_key_and_keep_the_rules() -> None:
    many = MjxEnvironments(make_task(TASKS["joshua/SoArm100PickPlace-v0"], "", None, True))
    keys = jax.random.split(jax.random.PRNGKey(0), 300)
    carry, _ = jax.jit(many.reset)(keys)
    cube, goal = np.asarray(carry["qpos"][:, 6:8]), np.asarray(carry["mocap_pos"][:, 0, :2])
    assert np.hypot(*(cube - goal).T).min() >= 0.07
    assert len(np.unique(cube[:, 0])) == 300
    few, _ = jax.jit(many.reset)(keys[:3])
    for name in ("qpos", "mocap_pos", "keys"):
        assert np.array_equal(few[name], carry[name][:3]), name
    gain = np.asarray(carry["parameters"]["actuator_gainprm"][:, :, 0]) / 998.22
    assert (np.abs(gain - 1) < 0.2).all()
    assert gain.std() > 0.05


def test_an_episode_ends_beyond_the_limit_of_mujoco(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its observation and reward would fill the running moments, in which nothing else then counts."""
    many = MjxEnvironments(make_task(TASKS["joshua/SoArm100Reach-v0"], "", None, False))
    carry, _ = many.reset(jax.random.split(jax.random.PRNGKey(4), 2))
    fast = carry["qvel"].at[1, 2].set(2e10)
    monkeypatch.setattr(many, "_moved", lambda one: {"qvel": one["qvel"]})  # whatever moved it so
    carry, done = many.advance({**carry, "qvel": fast}, jnp.zeros((2, 6)))
    assert done.terminated.tolist() == [False, True]
    assert float(done.rewards[1]) == 0.0
    assert not np.asarray(done.final[1]).any()


def test_episodes_end_and_start_again_and_a_diverged_one_leaves_no_trace() -> None:
    task = replace(make_task(TASKS["joshua/SoArm100Reach-v0"], "", None, True), max_steps=3)
    many = MjxEnvironments(task)
    carry, _ = jax.jit(many.reset)(jax.random.split(jax.random.PRNGKey(4), 3))
    step = jax.jit(many.step)
    carry["qvel"] = carry["qvel"].at[1, 2].set(jnp.nan)
    goals = np.asarray(carry["mocap_pos"][:, 0])
    for count in range(1, 4):
        carry, done = step(carry, jnp.zeros((3, 6)))
        assert done.truncated.tolist() == [count == 3, False, count == 3]
        assert done.terminated.tolist() == [False, count == 1, False]
        assert np.isfinite(np.asarray(done.observations)).all()
        assert np.isfinite(np.asarray(done.rewards)).all()
        assert float(done.rewards[1]) == 0.0 or count > 1
    assert carry["elapsed_steps"].tolist() == [0, 2, 0]
    assert (np.asarray(carry["mocap_pos"][:, 0]) != goals).any(axis=1).all()


def test_the_preset_trains_ends_with_a_picture_and_goes_on_after_ctrl_c_and_sigkill(tmp_path: Path) -> None:
    """Stopped after a checkpoint, and killed while it learns on, a run becomes what a whole one does."""
    generator = random.Random()
    with reserved_domain() as domain:
        whole = start(tmp_path / "whole", domain)
        said, _ = whole.communicate(timeout=400)
        assert whole.returncode == 0, said
        stopped = start(tmp_path / "stopped", domain)
        deadline = time.monotonic() + 300
        while time.monotonic() < deadline and not newest_checkpoint(tmp_path / "stopped"):
            time.sleep(0.02)
        os.kill(stopped.pid, signal.SIGINT)
        ending, _ = stopped.communicate(timeout=60)
        assert "SIGKILL" not in ending
        (run,) = (tmp_path / "stopped").iterdir()
        assert curve(run)[-1]["steps"] == int(max((run / "checkpoints").iterdir()).name[5:])
        own = f'resume_run="{run}"'
        killed = start(tmp_path / "stopped", domain, own)
        assert killed_while_learning(killed, tmp_path / "stopped", generator, 0.2), "ended before the kill"
        assert killed.returncode == -signal.SIGKILL
        resumed = start(tmp_path / "stopped", domain, own)
        again, _ = resumed.communicate(timeout=400)
    assert resumed.returncode == 0, again
    assert "continuing after" in again
    assert "JAX found no accelerator" in said
    assert "640 steps learned" in said
    assert [path.name for path in (tmp_path / "stopped").iterdir()] == [run.name]
    (other,) = (tmp_path / "whole").iterdir()
    assert (other / "curves.svg").read_text().startswith("<svg")
    assert curve(run) == curve(other)
    assert same(run, other)
    last = max((run / "checkpoints").iterdir())
    facts = json.loads((run / "run.json").read_text())
    assert {"joshua-mjx-trainer", "jax", "mujoco-mjx"} <= set(facts["versions"])
    environment = make_environment("joshua/SoArm100Reach-v0")
    observation, _ = environment.reset(seed=0)
    action = Policy.load(last).act(observation[None])[0]
    assert environment.action_space.contains(action)
    names = tuple(environment.unwrapped.features[STATE].names)
    joints = JointSpace(names, np.full(6, -3.0), np.full(6, 3.0))
    model = PpoModel(PpoPolicySettings(weights=str(run), goal_m=(0.1, -0.2, 0.15), rate_hz=25.0), joints)
    model.load()
    goals = model.act(Observation(1, {STATE: np.zeros(6, np.float32)}))
    assert goals.shape == (1, 6)
    model.close()


def test_a_platform_that_is_not_there_is_named(tmp_path: Path) -> None:
    with reserved_domain() as domain:
        ended = start(tmp_path, domain, platform="cuda")
        said, _ = ended.communicate(timeout=200)
    assert ended.returncode == 1, said
    assert "JAX finds no device of the platform 'cuda', which JAX_PLATFORMS names: install jax[cu" in said
    assert "Traceback" not in said
