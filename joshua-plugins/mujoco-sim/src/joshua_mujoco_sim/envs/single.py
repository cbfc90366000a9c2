"""One environment with the Gymnasium interface."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import mujoco
import numpy as np

from joshua_mujoco_sim.envs.pixels import SIZE, Observer, first, refuse_unseen
from joshua_mujoco_sim.envs.state import SingleState
from joshua_mujoco_sim.envs.terms import Evaluator, Task
from joshua_mujoco_sim.model_file import load_model
from joshua_mujoco_sim.rendering import CameraRenderer

_ONLY = np.zeros(1, np.int64)


class TermEnv(gymnasium.Env[Any, Any]):
    """An environment that a task describes. Actions are float32, and so are the numbers of observations.

    ``features`` names the parts of an observation, which stand side by side in it, and of an action, in their
    own units. The numbers of an observation are scaled by constants of the task; ``physical`` undoes that.
    ``info`` carries each reward term (``reward_terms``), the poses of objects (``objects``), each reason to
    end that holds (``ended_by``), and ``is_success`` if the task judges it.

    Args:
        task: makes the task, given the name of a reward function.
        reward_function: one of the task's; "" for its default.
        weights: other weights of some reward terms.
        randomise: randomised physics from episode to episode.
        action_mode: one of the task's, such as ``delta`` or ``absolute`` of an arm; "" for its default.
        observation_mode: ``state``, ``pixels`` or ``both``; cameras: that are shown then, () for the task's.
        shadows: draw them.
        render_mode: ``rgb_array`` or None; width, height: of pictures in pixels.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 25}  # noqa: RUF012 - Gymnasium's own form

    def __init__(
        self,
        task: Callable[..., Task],
        *,
        reward_function: str = "",
        weights: Mapping[str, float] | None = None,
        randomise: bool = False,
        action_mode: str = "",
        observation_mode: str = "state",
        cameras: Sequence[str] = (),
        shadows: bool = False,
        render_mode: str | None = None,
        width: int = SIZE[0],
        height: int = SIZE[1],
    ) -> None:
        self.task = make_task(task, reward_function, weights, randomise)
        model = task_model(self.task)
        self.metadata = {
            "render_modes": ["rgb_array"],
            "render_fps": round(1 / (self.task.frame_skip * model.opt.timestep)),
        }
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode {render_mode!r} is unknown: choose 'rgb_array' or None")
        self.render_mode = render_mode
        self._size, self._shadows = (width, height), shadows
        self._renderer: CameraRenderer | None = None
        self._state = SingleState(model, self.task.action_size, self.task.forces)
        self.task.prepare(self._state)
        self._evaluator = Evaluator(self.task, self._state, action_mode)
        shown = shown_cameras(self.task, observation_mode, cameras)
        if render_mode is None:
            refuse_unseen(observation_mode, width, height, shadows)
        self._observer = Observer(
            self._evaluator, self._state, observation_mode, shown, width, height, shadows
        )
        self.features = self._evaluator.features
        self.action_space = self._evaluator.action_space
        self.observation_space = self._observer.space

    @property
    def state(self) -> SingleState:
        """The simulation, for tests and custom terms."""
        return self._state

    @property
    def judges_success(self) -> bool:
        """Whether ``info`` has ``is_success``."""
        return self.task.judges_success

    @property
    def observation_scaling(self) -> tuple[Any, Any]:
        """Offset and scale of the numbers: an observation shows ``(value - offset) / scale``."""
        return self._evaluator.offset, self._evaluator.scale

    def physical(self, observation: Any) -> Any:
        """The numbers of an observation in the units that ``features`` names."""
        return np.asarray(observation) * self._evaluator.scale + self._evaluator.offset

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode; the same seed gives the same episode."""
        super().reset(seed=seed)
        self._evaluator.reset(_ONLY, (self.np_random,))
        return self.observe()

    def observe(self) -> tuple[Any, dict[str, Any]]:
        """Return observation and ``info`` of the present state, which may have been changed after a reset."""
        return first(self._observer.all()), {"objects": first(self._evaluator.objects())}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Apply one action. Raises ValueError if its shape is wrong or it is not finite."""
        state, evaluator = self._state, self._evaluator
        evaluator.act(np.asarray(action)[None])
        state.step(self.task.frame_skip)
        state.elapsed_steps += 1
        reward, terms = evaluator.reward()
        ended, success, reasons = evaluator.terminated()
        info: dict[str, Any] = {"reward_terms": {name: float(value[0]) for name, value in terms.items()}}
        if ended[0]:
            info["ended_by"] = [name for name, reason in reasons.items() if reason[0]]
        if self.judges_success:
            info["is_success"] = bool(success[0])
        info["objects"] = first(evaluator.objects())
        return first(self._observer.all()), float(reward[0]), bool(ended[0]), False, info

    def observe_robot(self, position_rad: Any, velocity_rad_s: Any, goal_m: Any) -> Any:
        """Return the observation of a robot with these joints, without simulation.

        Args:
            position_rad, velocity_rad_s: of the model's joints in their order.
            goal_m: where the goal is, shape (3,).
        """
        state = self._state
        state.qpos[0], state.qvel[0], state.mocap_pos[0, 0] = position_rad, velocity_rad_s, goal_m
        if state.elapsed_steps[0] == 0:
            state.ctrl[0] = position_rad
        state.forward(_ONLY)
        return first(self._observer.all())

    def goals_of(self, action: Any) -> Any:
        """Return the servo goals, rad, of an action for the last observed robot."""
        self._evaluator.act(np.asarray(action)[None])
        self._state.elapsed_steps += 1
        return self._state.ctrl[0].copy()

    def render(self) -> Any:
        """Draw the task's camera: shape (H, W, 3), RGB; None without a render mode."""
        if self.render_mode is None:
            gymnasium.logger.warn("render requires an environment that was made with render_mode")
            return None
        if self._renderer is None:
            self._renderer = CameraRenderer(
                self._state.model, self.task.camera, *self._size, shadows=self._shadows
            )
        self._renderer.look(self._state.data)
        return self._renderer.draw()

    def close(self) -> None:
        """Free the pictures. Idempotent."""
        self._observer.close()
        renderer, self._renderer = self._renderer, None
        if renderer is not None:
            renderer.close()


def make_task(
    task: Callable[..., Task],
    reward_function: str,
    weights: Mapping[str, float] | None,
    randomise: bool,
) -> Task:
    """Return a task with the caller's changes.

    Raises:
        ValueError: the task has nothing that ``randomise`` could vary.
    """
    made = task(reward_function) if reward_function else task()
    if weights:
        made = made.with_weights(weights)
    if not randomise:
        return made
    if not made.randomisation:
        raise ValueError(
            f"randomise=True has no effect: the task on {made.model_path} has no terms in randomisation; "
            "remove it"
        )
    return made.with_resets(*made.randomisation)


def task_model(task: Task) -> mujoco.MjModel:
    """Compile the model of a task. Raises ModelError, see ``load_model``."""
    model = load_model(task.model_path)
    if any(term.failure for term in task.terminations):
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    return model


def shown_cameras(task: Task, observation_mode: str, cameras: Sequence[str]) -> Sequence[str]:
    """Return the cameras of observations: the requested ones, else the task's."""
    return cameras or (() if observation_mode == "state" else (task.camera,))
