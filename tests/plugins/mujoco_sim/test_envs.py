"""The environments: Gymnasium's own checks, seeds, terms, and one that equals many."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from joshua.features import ACTION, STATE
from joshua_mujoco_sim.envs import TASKS, TermEnv, TermVectorEnv, make_environment
from joshua_mujoco_sim.envs.tasks import reach
from joshua_mujoco_sim.envs.terms import ResetTerm
from joshua_mujoco_sim.opengl import RenderingError, choose_gl

IDS = sorted(TASKS)


def has_gl() -> bool:
    try:
        choose_gl()
    except RenderingError:
        return False
    return True


@pytest.fixture(params=IDS)
def environment(request):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*infinity.*")
        made = gymnasium.make(request.param)
        yield made
        made.close()


def rollout(environment, seed: int, steps: int = 20) -> list:
    seen = [environment.reset(seed=seed)[0]]
    generator = np.random.default_rng(seed)
    for _ in range(steps):
        action = generator.uniform(-1, 1, environment.action_space.shape)
        observation, reward, terminated, truncated, _ = environment.step(action)
        seen += [observation, reward]
        if terminated or truncated:
            break
    return seen


@pytest.mark.parametrize("name", IDS)
def test_passes_the_checks_of_gymnasium(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*infinity.*")
        mode = "rgb_array" if has_gl() else None
        made = gymnasium.make(name, render_mode=mode, disable_env_checker=True)
        check_env(made.unwrapped, skip_render_check=not has_gl())
        made.close()


def test_features_describe_observation_and_action(environment) -> None:
    features = environment.unwrapped.features
    observed = [feature for key, feature in features.items() if key != ACTION]
    assert all(key.startswith("observation.") for key in features if key != ACTION)
    assert sum(feature.shape[0] for feature in observed) == environment.observation_space.shape[0]
    assert features[ACTION].shape == environment.action_space.shape
    assert len(features[ACTION].names) == environment.action_space.shape[0]


def test_the_arm_is_observed_as_data_sets_record_it() -> None:
    environment = TermEnv(reach)
    state = environment.features[STATE]
    assert (state.names[0], state.names[-1], state.unit) == ("shoulder_pan", "gripper", "rad")
    observation, _ = environment.reset(seed=0)
    assert observation[:6] == pytest.approx(environment.state.qpos[0, :6])


def test_seed_decides_every_bit(environment) -> None:
    first, second, other = rollout(environment, 3), rollout(environment, 3), rollout(environment, 4)
    for a, b in zip(first, second, strict=True):
        assert np.array_equal(a, b)
    assert not np.array_equal(first[0], other[0])


def test_reward_is_the_sum_of_its_terms(environment) -> None:
    environment.reset(seed=0)
    _, reward, _, _, info = environment.step(environment.action_space.sample())
    assert reward == pytest.approx(sum(info["reward_terms"].values()))
    assert info["is_success"] is False


def test_episode_is_cut_off_at_its_length() -> None:
    environment = gymnasium.make("joshua/SoArm100PickPlace-v0")
    environment.reset(seed=1)
    for _ in range(200):
        _, _, terminated, truncated, _ = environment.step(np.zeros(6))
    assert truncated
    assert not terminated


@pytest.mark.parametrize("name", IDS)
def test_many_are_as_one(name: str) -> None:
    """The k-th of many environments runs what a single one runs with the seed of the k-th, bit for bit."""
    many = TermVectorEnv(TASKS[name], 3)
    singles = [gymnasium.make(name, disable_env_checker=True).unwrapped for _ in range(3)]
    observations, _ = many.reset(seed=7)
    for k, single in enumerate(singles):
        assert np.array_equal(observations[k], single.reset(seed=7 + k)[0])
    generator = np.random.default_rng(0)
    for _ in range(15):
        actions = generator.uniform(-1, 1, many.action_space.shape)
        observations, rewards, ended, _, info = many.step(actions)
        for k, single in enumerate(singles):
            observation, reward, terminated, _, single_info = single.step(actions[k])
            assert np.array_equal(observations[k], observation)
            assert rewards[k] == reward
            assert ended[k] == terminated
            for term, value in single_info["reward_terms"].items():
                assert info["reward_terms"][term][k] == value
        if ended.any():
            break


def test_ended_episodes_start_anew_with_the_next_step() -> None:
    many = TermVectorEnv(TASKS["joshua/SoArm100Reach-v0"], 2)
    many.reset(seed=0)
    for step in range(1, 76):
        _, _, ended, truncated, _ = many.step(np.zeros((2, 6)))
        assert truncated.tolist() == [step == 75] * 2, step
        assert not ended.any()
    before = many.state.qpos.copy()
    observations, rewards, _, truncated, _ = many.step(np.zeros((2, 6)))
    assert rewards.tolist() == [0.0, 0.0]
    assert not truncated.any()
    assert not np.array_equal(many.state.qpos, before)
    assert many.state.elapsed_steps.tolist() == [0, 0]
    assert np.isfinite(observations).all()


def test_gymnasium_makes_many_at_once() -> None:
    many = gymnasium.make_vec("joshua/SoArm100Reach-v0", num_envs=2, max_episode_steps=3)
    assert isinstance(many, TermVectorEnv)
    many.reset(seed=0)
    cut = [many.step(np.zeros((2, 6)))[3].tolist() for _ in range(3)]
    assert cut == [[False, False], [False, False], [True, True]]


def test_many_run_on_any_number_of_cores_alike() -> None:
    results = []
    for threads in (1, 2):
        many = TermVectorEnv(TASKS["joshua/Ant-v0"], 8, threads=threads)
        many.reset(seed=5)
        for _ in range(10):
            observations = many.step(np.full((8, 8), 0.3))[0]
        results.append(observations)
    assert np.array_equal(*results)


def test_reach_can_be_solved() -> None:
    """A controller that follows the Jacobian of the grip reaches the goal, so the task is possible."""
    environment: Any = gymnasium.make("joshua/SoArm100Reach-v0").unwrapped
    state = environment.state
    site = state.model.site("gripper").id
    successes = 0
    for seed in range(5):
        environment.reset(seed=seed)
        for _ in range(75):
            jacobian = np.zeros((3, state.model.nv))
            mujoco.mj_jacSite(state.model, state.data, jacobian, None, site)
            error = (state.site("goal") - state.site("gripper"))[0]
            rows = jacobian[:, :5]
            change = rows.T @ np.linalg.solve(rows @ rows.T + 1e-4 * np.eye(3), error)
            ahead = state.ctrl[0, :5] - state.qpos[0, :5]
            action = np.append((change - ahead) / 0.1, 0.0)
            _, _, terminated, _, info = environment.step(action)
            if terminated:
                successes += info["is_success"]
                assert info["ended_by"] == ["reached"]
                break
    assert successes >= 4


def test_weights_change_and_take_out_terms() -> None:
    environment = make_environment("joshua/SoArm100Reach-v0", weights={"closeness": 3.0, "joint_speed": 0})
    environment.reset(seed=0)
    info = environment.step(np.zeros(6))[4]
    assert list(info["reward_terms"]) == ["closeness", "fine_closeness", "action_change"]
    with pytest.raises(KeyError, match=r"no reward term near.*the task has closeness"):
        reach().with_weights({"near": 1.0})


def test_reward_function_is_chosen_by_name() -> None:
    environment = make_environment("joshua/SoArm100Reach-v0", "reach_sparse")
    environment.reset(seed=0)
    assert list(environment.step(np.zeros(6))[4]["reward_terms"]) == ["reached"]
    with pytest.raises(ValueError, match="no reward function 'spare': choose reach or reach_sparse"):
        make_environment("joshua/SoArm100Reach-v0", "spare")


def test_unknown_environment_lists_the_known() -> None:
    with pytest.raises(ValueError, match="no environment 'joshua/Reach-v0': choose joshua/SoArm100Reach-v0"):
        make_environment("joshua/Reach-v0")


@pytest.mark.parametrize("many", [False, True])
def test_physics_is_randomised_from_episode_to_episode(many: bool) -> None:
    name = "joshua/SoArm100PickPlace-v0"
    if many:
        environment = TermVectorEnv(TASKS[name], 2, randomise=True)
    else:
        environment = make_environment(name, randomise=True).unwrapped
    fields = ("geom_friction", "actuator_gainprm", "dof_damping")

    def parameters() -> list:
        return [np.array(environment.state.parameter(field)) for field in fields]

    environment.reset(seed=1)
    first = parameters()
    environment.reset(seed=2)
    second = parameters()
    environment.reset(seed=1)
    for a, b, c in zip(first, second, parameters(), strict=True):
        assert not np.array_equal(a, b)
        assert np.array_equal(a, c)
    gain, bias = (
        environment.state.parameter("actuator_gainprm"),
        environment.state.parameter("actuator_biasprm"),
    )
    assert bias[..., 1] == pytest.approx(-gain[..., 0])
    assert (np.abs(gain[..., 0] / 998.22 - 1) <= 0.2).all()


def test_own_terms_can_be_added() -> None:
    def mark(state, ids, generators, *, value: float) -> None:
        state.memory["mark"] = np.full(len(ids), value)

    task = reach().with_resets(ResetTerm("mark", mark, {"value": 3.0}))
    many = TermVectorEnv(lambda: task, 2)
    assert many.state.memory["mark"].tolist() == [3.0, 3.0]


@pytest.mark.skipif(not has_gl(), reason="no OpenGL library: sudo apt install libegl1 libgl1-mesa-dri")
def test_picture_has_the_size_that_was_asked() -> None:
    environment = make_environment("joshua/Ant-v0", render_mode="rgb_array", width=160, height=120)
    environment.reset(seed=0)
    picture = environment.render()
    assert picture.shape == (120, 160, 3)
    assert picture.std() > 10
    environment.close()


def test_bad_actions_and_modes_are_refused() -> None:
    environment = gymnasium.make("joshua/Ant-v0", disable_env_checker=True).unwrapped
    environment.reset(seed=0)
    with pytest.raises(ValueError, match="is not finite"):
        environment.step(np.full(8, np.nan))
    with pytest.raises(ValueError, match="render_mode 'human' is unknown"):
        TermEnv(TASKS["joshua/Ant-v0"], render_mode="human")
