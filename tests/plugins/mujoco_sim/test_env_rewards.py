"""Rewards: whoever finishes a task earns more than whoever lingers beside it, for every task and reward."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from joshua_mujoco_sim.envs import TASKS, TermEnv, TermVectorEnv, make_environment
from joshua_mujoco_sim.envs.arm_terms import HALF_CUBE_M, PLACED_M, REST_M_S
from joshua_mujoco_sim.envs.experts import EXPERTS
from joshua_mujoco_sim.plugin import ENVIRONMENTS


def play(name: str, reward: str, choose: Callable[[Any, Any], Any]) -> tuple[float, float, bool]:
    """Returns of an episode, without and with a discount of 0.99, and whether it succeeded."""
    environment = make_environment(name, reward).unwrapped
    total = discounted = 0.0
    expert: Any = EXPERTS[name](environment)
    environment.reset(seed=1)
    expert.reset()
    for step in range(environment.task.max_steps):
        action = choose(environment, expert)
        _, value, terminated, _, info = environment.step(action)
        total += value
        discounted += value * 0.99**step
        if terminated:
            break
    return total, discounted, info["is_success"]


def finish(environment: Any, expert: Any) -> Any:
    return expert.act()


class Beside:
    """The state as an expert sees it that takes a place before the goal for the goal."""

    def __init__(self, state: Any, shift_m: float) -> None:
        way = np.array([0.0, -0.25, 0.1]) - state.site("goal")[0]
        self._state, self._shift_m = state, shift_m * way / np.linalg.norm(way)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._state, name)

    def site(self, name: str) -> Any:
        return self._state.site(name) + (self._shift_m if name == "goal" else 0.0)


def stay_beside(environment: Any, expert: Any, more_m: float = 0.0) -> Any:
    """Stays near without success until the time is over; puts the cube down there, again and again."""
    expert._state = Beside(environment.state, (0.05 if "cube" in environment.task.objects else 0.03) + more_m)
    return expert.act()


def hold(environment: Any, expert: Any) -> Any:
    """Holds the cube above the goal until the time is over; for reaching, stays where it starts."""
    state, memory = environment.state, environment.state.memory
    if "cube" not in environment.task.objects:
        return np.zeros(6)
    way = (state.site("cube") - state.site("goal"))[0]
    if np.hypot(*way[:2]) < 0.02 and way[2] > 0.01:
        memory["there"] = np.ones(1)
    return np.zeros(6) if "there" in memory else expert.act()


def wander(environment: Any, expert: Any) -> Any:
    """Goes there and back, again and again, as what counts every approach would pay best."""
    back = environment.state.elapsed_steps[0] // 6 % 2 == 0
    return stay_beside(environment, expert, 0.06 if back else 0.0)


@pytest.mark.parametrize(
    ("name", "reward"),
    [(offer.id, reward) for offer in ENVIRONMENTS if offer.id in EXPERTS for reward in offer.rewards],
)
def test_finishing_pays_more_than_lingering(name: str, reward: str) -> None:
    total, discounted, success = play(name, reward, finish)
    assert success
    for other in (stay_beside, hold, wander):
        paid, paid_discounted, success = play(name, reward, other)
        assert not success
        assert total > paid + 0.5
        assert discounted > paid_discounted + 0.25


def test_every_task_that_can_succeed_has_been_played() -> None:
    """A task with a success needs an expert, or the comparison above says nothing of it."""
    for name, task in TASKS.items():
        assert (name in EXPERTS) == task().judges_success


@pytest.mark.parametrize("name", TASKS)
def test_only_a_task_that_can_succeed_speaks_of_success(name: str) -> None:
    one, many = TermEnv(TASKS[name]), TermVectorEnv(TASKS[name], 2)
    for environment in (one, many):
        environment.reset(seed=0)
        *_, info = environment.step(np.zeros(environment.action_space.shape))
        assert ("is_success" in info) == environment.judges_success == (name in EXPERTS)


def test_losing_the_cube_never_pays() -> None:
    environment = make_environment("joshua/SoArm100PickPlace-v0").unwrapped
    environment.reset(seed=0)
    environment.state.qpos[0, 6:9] = (0.0, -0.3, -0.2)
    _, reward, terminated, _, info = environment.step(np.zeros(6))
    assert terminated
    assert info["ended_by"] == ["dropped"]
    assert reward < -10


def test_a_cube_that_slides_across_the_goal_is_not_placed() -> None:
    """The episode goes on until the cube rests; on the goal that is a success."""
    environment = make_environment("joshua/SoArm100PickPlace-v0").unwrapped
    state = environment.state
    for speed_m_s, rests_there in ((0.6, False), (0.0, True)):
        environment.reset(seed=0)
        state.qpos[0, 6:9] = (*state.site("goal")[0, :2], HALF_CUBE_M)
        state.qvel[0, 6] = speed_m_s
        # the first step leaves a fast cube within the goal: it moves by no more than the goal's radius
        state.mocap_pos[0, 0, 0] += 0.01 * (speed_m_s > 0.0)
        *_, terminated, _, info = environment.step(np.zeros(6))
        assert (np.linalg.norm(state.qvel[0, 6:9]) < REST_M_S) == rests_there
        assert np.hypot(*(state.site("cube") - state.site("goal"))[0, :2]) < PLACED_M
        assert (terminated, info["is_success"]) == (rests_there, rests_there)
