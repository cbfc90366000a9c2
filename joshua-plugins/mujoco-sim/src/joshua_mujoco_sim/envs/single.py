"""One environment by the Gymnasium interface."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import gymnasium
import numpy as np

from joshua_mujoco_sim.envs.state import SingleState
from joshua_mujoco_sim.envs.tasks import ARM_RANDOMISATION
from joshua_mujoco_sim.envs.terms import Evaluator, Task
from joshua_mujoco_sim.model_file import load_model
from joshua_mujoco_sim.rendering import CameraRenderer

_ONLY = np.zeros(1, np.int64)


class TermEnv(gymnasium.Env[Any, Any]):
    """An environment that a task describes. Actions are in [-1, 1]; observations float32.

    ``features`` names the parts of an observation, which stand side by side in it, and of an action.
    ``info`` carries each reward term (``reward_terms``), each reason to end that holds (``ended_by``), and
    ``is_success``.

    Args:
        task: makes the task, given the name of a reward function.
        reward_function: one of the task's; "" for its default.
        weights: other weights of some reward terms.
        randomise: randomised physics of the arm from episode to episode.
        render_mode: ``rgb_array`` or None; width, height: of the picture in pixels.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 25}  # noqa: RUF012 - Gymnasium's own form

    def __init__(
        self,
        task: Callable[..., Task],
        *,
        reward_function: str = "",
        weights: Mapping[str, float] | None = None,
        randomise: bool = False,
        render_mode: str | None = None,
        width: int = 320,
        height: int = 240,
    ) -> None:
        self.task = make_task(task, reward_function, weights, randomise)
        model = load_model(self.task.model_path)
        self.metadata = {
            "render_modes": ["rgb_array"],
            "render_fps": round(1 / (self.task.frame_skip * model.opt.timestep)),
        }
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode {render_mode!r} is unknown: choose 'rgb_array' or None")
        self.render_mode = render_mode
        self._size = (width, height)
        self._renderer: CameraRenderer | None = None
        self._state = SingleState(model, self.task.action_size)
        self.task.prepare(self._state)
        self._evaluator = Evaluator(self.task, self._state)
        self._keyframe = model.key("home").id if model.nkey else -1
        self.features = self._evaluator.features
        self.action_space = self._evaluator.action_space
        self.observation_space = self._evaluator.observation_space

    @property
    def state(self) -> SingleState:
        """The simulation, for tests and for own terms."""
        return self._state

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts an episode; the same seed starts the same one."""
        super().reset(seed=seed)
        state = self._state
        state.reset(_ONLY, self._keyframe)
        state.action[:] = state.last_action[:] = 0.0
        state.elapsed_steps[:] = 0
        self._evaluator.reset(_ONLY, (self.np_random,))
        state.forward(_ONLY)
        return self._evaluator.observation()[0], {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Does one action. Raises ValueError for one that has another shape or is not finite."""
        state, evaluator = self._state, self._evaluator
        state.last_action[:] = state.action
        np.minimum(action, 1.0, out=state.action[0])
        np.maximum(state.action, -1.0, out=state.action)
        if np.isnan(np.add.reduce(state.action[0])):
            raise ValueError(f"the action {action} is not finite")
        self.task.action(state)
        state.step(self.task.frame_skip)
        state.elapsed_steps += 1
        reward, terms = evaluator.reward()
        ended, success, reasons = evaluator.terminated()
        info: dict[str, Any] = {"reward_terms": {name: float(value[0]) for name, value in terms.items()}}
        if ended[0]:
            info["ended_by"] = [name for name, reason in reasons.items() if reason[0]]
        info["is_success"] = bool(success[0])
        return evaluator.observation()[0], float(reward[0]), bool(ended[0]), False, info

    def render(self) -> Any:
        """Draws the task's camera: shape (H, W, 3), RGB; None without a render mode."""
        if self.render_mode is None:
            gymnasium.logger.warn("render was called, and the environment was made without render_mode")
            return None
        if self._renderer is None:
            self._renderer = CameraRenderer(self._state.model, self.task.camera, *self._size, shadows=False)
        self._renderer.look(self._state.data)
        return self._renderer.draw()

    def close(self) -> None:
        """Frees the picture; a second call does nothing."""
        renderer, self._renderer = self._renderer, None
        if renderer is not None:
            renderer.close()


def make_task(
    task: Callable[..., Task],
    reward_function: str,
    weights: Mapping[str, float] | None,
    randomise: bool,
) -> Task:
    """Makes a task with what the caller changes of it."""
    made = task(reward_function) if reward_function else task()
    if weights:
        made = made.with_weights(weights)
    if randomise:
        made = made.with_resets(*ARM_RANDOMISATION) if "so_arm100" in made.model_path else made
    return made
