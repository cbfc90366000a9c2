"""The environments: Gymnasium's own checks, seeds, terms, and one that equals many."""

from __future__ import annotations

import warnings
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box
from gymnasium.utils.env_checker import check_env
from joshua.features import ACTION, STATE
from joshua_mujoco_sim.envs import TASKS, TermEnv, TermVectorEnv, make_environment
from joshua_mujoco_sim.envs.starts import Draws, Start, with_values
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
    assert np.abs(observation[:6]).max() <= 1.0
    assert environment.physical(observation)[:6] == pytest.approx(environment.state.qpos[0, :6], abs=1e-6)


def test_seed_decides_every_bit(environment) -> None:
    first, second, other = rollout(environment, 3), rollout(environment, 3), rollout(environment, 4)
    for a, b in zip(first, second, strict=True):
        assert np.array_equal(a, b)
    assert not np.array_equal(first[0], other[0])


def test_reward_is_the_sum_of_its_terms(environment) -> None:
    environment.reset(seed=0)
    _, reward, _, _, info = environment.step(environment.action_space.sample())
    assert reward == pytest.approx(sum(info["reward_terms"].values()))
    assert not info.get("is_success")


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
    observations, rewards, _, truncated, info = many.step(np.zeros((2, 6)))
    assert rewards.tolist() == [0.0, 0.0]
    assert all(not values.any() for values in info["reward_terms"].values())
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


def test_weights_change_and_take_out_terms() -> None:
    environment = make_environment("joshua/SoArm100Reach-v0", weights={"approach": 3.0, "joint_speed": 0})
    environment.reset(seed=0)
    info = environment.step(np.zeros(6))[4]
    assert list(info["reward_terms"]) == ["approach", "fine_approach", "reached", "time", "action_change"]
    with pytest.raises(KeyError, match=r"no reward term near.*the task has approach"):
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
    def spin(start: Start, draws: Draws, *, most: float) -> Start:
        return replace(start, qvel=with_values(start.qvel, (slice(None), 4), draws.uniform(most / 2, most)))

    task = reach().with_resets(ResetTerm("spin", spin, {"most": 3.0}))
    many = TermVectorEnv(lambda: task, 2)
    many.reset(seed=1)
    spun = many.state.qvel[:, 4]
    assert ((spun > 1.5) & (spun < 3.0)).all()
    assert spun[0] != spun[1]


@pytest.mark.skipif(not has_gl(), reason="no OpenGL library: sudo apt install libegl1 libgl1-mesa-dri")
def test_picture_has_the_size_that_was_asked() -> None:
    environment = make_environment("joshua/Ant-v0", render_mode="rgb_array", width=160, height=120)
    environment.reset(seed=0)
    picture = environment.render()
    assert picture.shape == (120, 160, 3)
    assert picture.std() > 10
    environment.close()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_bad_action_leaves_no_trace(bad: float) -> None:
    """The rewards after a refused action are those of an environment that never saw it."""
    name = "joshua/SoArm100Reach-v0"
    one, other = (make_environment(name, disable_env_checker=True).unwrapped for _ in range(2))
    many = TermVectorEnv(TASKS[name], 2)
    for environment in (one, other, many):
        environment.reset(seed=0)
    with pytest.raises(ValueError, match="environment 0 is not finite"):
        one.step(np.full(6, bad))
    with pytest.raises(ValueError, match="environment 1 is not finite"):
        many.step(np.stack([np.zeros(6), np.full(6, bad)]))
    with pytest.raises(ValueError, match=r"shape \(5,\), not \(6,\)"):
        one.step(np.zeros(5))
    action = np.full(6, 0.3)
    expected = other.step(action)
    assert one.step(action)[1] == expected[1]
    assert many.step(np.stack([action, action]))[1][0] == expected[1]


@pytest.mark.parametrize("mode", ["delta", "absolute"])
@pytest.mark.parametrize("name", ["joshua/SoArm100Reach-v0", "joshua/SoArm100PickPlace-v0"])
def test_observations_are_about_one(name: str, mode: str) -> None:
    many = TermVectorEnv(TASKS[name], 16, action_mode=mode)
    assert many.features["observation.last_action"].unit == many.features[ACTION].unit
    seen = [many.reset(seed=0)[0]]
    chance = np.random.default_rng(0)
    space = many.single_action_space
    assert isinstance(space, Box)
    seen += [many.step(chance.uniform(space.low, space.high, (16, 6)))[0] for _ in range(70)]
    everything = np.concatenate(seen)
    assert np.abs(everything).max() < 6.0
    assert np.median(np.abs(everything), axis=0).max() < 2.5


@pytest.mark.parametrize("value", [1e12, np.nan])
@pytest.mark.parametrize("name", ["joshua/SoArm100Reach-v0", "joshua/SoArm100PickPlace-v0"])
def test_a_simulation_that_diverges_ends_its_episode_and_pays_nothing(name: str, value: float) -> None:
    one, still = (make_environment(name, disable_env_checker=True).unwrapped for _ in range(2))
    many = TermVectorEnv(TASKS[name], 2)
    for environment in (one, still, many):
        environment.reset(seed=0)
    many.reset(seed=[None, 0])
    one.state.qvel[0, 0] = many.state.qvel[0, 0] = value
    observation, reward, terminated, _, info = one.step(np.zeros(6))
    observations, rewards, ended, _, infos = many.step(np.zeros((2, 6)))
    expected = still.step(np.zeros(6))
    assert (reward, terminated) == (0.0, True)
    assert info["ended_by"] == ["diverged"]
    assert not info["is_success"]
    assert not any(info["reward_terms"].values())
    assert not observation.any()
    assert all(np.isfinite(place).all() for place in info["objects"].values())
    assert rewards.tolist() == [0.0, expected[1]]
    assert ended.tolist() == [True, False]
    assert infos["reward_terms"]["action_change"].tolist() == [0.0, 0.0]
    assert not observations[0].any()
    assert np.array_equal(observations[1], expected[0])
    rewards, ended = many.step(np.zeros((2, 6)))[1:3]
    assert (rewards[0], ended[0]) == (0.0, False)
    assert np.isfinite(many.state.qpos).all()


def test_objects_are_in_info() -> None:
    name = "joshua/SoArm100PickPlace-v0"
    one = make_environment(name).unwrapped
    many = TermVectorEnv(TASKS[name], 2)
    info, infos = one.reset(seed=4)[1], many.reset(seed=4)[1]
    for _ in range(2):
        assert info["objects"]["cube"][:3] == pytest.approx(one.state.site("cube")[0], abs=1e-4)
        assert info["objects"]["goal"].shape == (3,)
        for key, value in info["objects"].items():
            assert np.array_equal(infos["objects"][key][0], value)
        info, infos = one.step(np.zeros(6))[-1], many.step(np.zeros((2, 6)))[-1]


def test_reset_mask_starts_some_episodes() -> None:
    many = TermVectorEnv(TASKS["joshua/SoArm100Reach-v0"], 3)
    many.reset(seed=0)
    for _ in range(4):
        many.step(np.full((3, 6), 0.5))
    before = many.state.qpos.copy()
    mask = np.array([False, True, False])
    observations, _ = many.reset(seed=20, options={"reset_mask": mask})
    assert many.state.elapsed_steps.tolist() == [4, 0, 4]
    assert np.array_equal(many.state.qpos[~mask], before[~mask])
    single = make_environment("joshua/SoArm100Reach-v0").unwrapped
    assert np.array_equal(observations[1], single.reset(seed=21)[0])
    rewards = many.step(np.full((3, 6), 0.5))[1]
    assert rewards[1] == single.step(np.full(6, 0.5))[1]
    for wrong in (np.ones(2, bool), np.ones(3)):
        with pytest.raises(ValueError, match="give 3 booleans"):
            many.reset(options={"reset_mask": wrong})
    with pytest.raises(ValueError, match="marks no environment"):
        many.reset(options={"reset_mask": np.zeros(3, bool)})
    for length in (1, 4):
        with pytest.raises(ValueError, match=f"list of {length}, and there are 3 env.*: give one number"):
            many.reset(seed=[*range(length)])


def test_episodes_can_start_anew_with_the_step_that_ended_them() -> None:
    name = "joshua/SoArm100Reach-v0"
    many = TermVectorEnv(TASKS[name], 2, autoreset_mode="SameStep", max_episode_steps=5)
    other = TermVectorEnv(TASKS[name], 2, max_episode_steps=5)
    many.reset(seed=0)
    other.reset(seed=0)
    actions = np.full((2, 6), 0.4)
    for _ in range(5):
        observations, rewards, _, truncated, info = many.step(actions)
        last = other.step(actions)
    assert truncated.all()
    assert np.array_equal(np.stack(info["final_obs"]), last[0])
    assert np.array_equal(rewards, last[1])
    fresh = other.step(actions)[0]  # there the start of the next episode takes a step of its own
    assert np.array_equal(observations, fresh)
    assert np.array_equal(many.step(actions)[1], other.step(actions)[1])


@pytest.mark.parametrize("name", IDS)
def test_environments_go_on_from_a_snapshot_bit_for_bit(name: str) -> None:
    made = [TermVectorEnv(TASKS[name], 3, randomise=True, max_episode_steps=8) for _ in range(2)]
    chance = np.random.default_rng(0)
    shape = made[0].action_space.shape
    assert shape is not None
    actions = chance.uniform(-1, 1, (30, *shape))
    made[0].reset(seed=3)
    for action in actions[:13]:
        made[0].step(action)
    made[1].reset(seed=99)
    made[1].restore(made[0].snapshot())
    for action in actions[13:]:
        first, other = (one.step(action) for one in made)
        for a, b in zip(first[:4], other[:4], strict=True):
            assert np.array_equal(a, b)
    with pytest.raises(ValueError, match="do not fit: physics is missing or of another shape"):
        made[0].restore(TermVectorEnv(TASKS[name], 2, randomise=True).snapshot())


@pytest.mark.parametrize("name", IDS)
def test_randomised_physics_acts_on_each_task(name: str) -> None:
    plain, varied = TermVectorEnv(TASKS[name], 4), TermVectorEnv(TASKS[name], 4, randomise=True)
    for many in (plain, varied):
        many.reset(seed=0)
        for _ in range(20):
            many.step(np.full(many.action_space.shape, 0.4))
    assert (np.abs(plain.state.qpos - varied.state.qpos).max(axis=1) > 1e-5).all()


def test_randomising_a_task_that_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match=r"randomise=True has no effect: the task on so_arm100/reach\.xml"):
        TermEnv(lambda: replace(reach(), randomisation=()), randomise=True)
