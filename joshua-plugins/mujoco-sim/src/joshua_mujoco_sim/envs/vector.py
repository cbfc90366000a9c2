"""Many environments at once, stepped on all cores by MuJoCo's own threads. Needs MuJoCo 4."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from joshua_mujoco_sim.envs.pixels import SIZE, Observer, refuse_unseen
from joshua_mujoco_sim.envs.single import make_task, shown_cameras, task_model
from joshua_mujoco_sim.envs.state import BatchState, IntArray
from joshua_mujoco_sim.envs.terms import Evaluator, Task

#: Fields of the model that the randomisation of servos varies, beside those that its terms name.
SERVO_FIELDS = ("actuator_gainprm", "actuator_biasprm")


@dataclass
class Outcome:
    """Result of one step of all environments, as arrays of shape (N, …).

    Attributes:
        observations: those that the next action answers, of fresh episodes where one has ended.
        success: of the task; False everywhere if it judges none.
        final: of the episodes that have ended, by the index of their environment; empty where none did.
    """

    observations: Any
    rewards: Any
    terminated: Any
    truncated: Any
    success: Any
    final: dict[int, Any]
    reward_terms: dict[str, Any]
    objects: dict[str, Any]


class TermVectorEnv(VectorEnv[Any, Any, Any]):
    """N environments of one task.

    Each environment has a random generator of its own: with the seed s the k-th one runs the episodes of a
    single environment with the seed s + k.

    Args:
        task: makes the task; num_envs: N; threads: cores to use, 0 for all.
        max_episode_steps: length after which an episode is cut off; None for the task's.
        autoreset_mode: when an episode that ended starts again: with the next step (``NEXT_STEP``), whose
            action has no effect and whose reward is 0, or with the step that ended it (``SAME_STEP``), whose
            last observation is in ``info["final_obs"]``.
        reward_function, weights, randomise, action_mode, observation_mode, cameras, width, height, shadows:
            as for a single environment.
    """

    def __init__(
        self,
        task: Callable[..., Task],
        num_envs: int,
        *,
        max_episode_steps: int | None = None,
        threads: int = 0,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        reward_function: str = "",
        weights: Mapping[str, float] | None = None,
        randomise: bool = False,
        action_mode: str = "",
        observation_mode: str = "state",
        cameras: Sequence[str] = (),
        width: int = SIZE[0],
        height: int = SIZE[1],
        shadows: bool = False,
    ) -> None:
        self.task = make_task(task, reward_function, weights, randomise)
        self._max_steps = max_episode_steps or self.task.max_steps
        model = task_model(self.task)
        self.num_envs = num_envs
        mode = AutoresetMode(autoreset_mode)
        if mode is AutoresetMode.DISABLED:
            raise ValueError("autoreset_mode DISABLED is not offered: choose NEXT_STEP or SAME_STEP")
        self._same_step = mode is AutoresetMode.SAME_STEP
        rate_hz = round(1 / (self.task.frame_skip * model.opt.timestep))
        self.metadata = {"autoreset_mode": mode, "render_modes": [], "render_fps": rate_hz}
        self.render_mode = None
        self._state = BatchState(model, num_envs, self.task.action_size, threads, self.task.forces)
        self.task.prepare(self._state)
        self._evaluator = Evaluator(self.task, self._state, action_mode)
        shown = shown_cameras(self.task, observation_mode, cameras)
        refuse_unseen(observation_mode, width, height, shadows)
        self._observer = Observer(
            self._evaluator, self._state, observation_mode, shown, width, height, shadows
        )
        self._generators = [np.random.default_rng() for _ in range(num_envs)]
        self._ended = np.zeros(num_envs, bool)
        self._reset(np.arange(num_envs))
        self.features = self._evaluator.features
        self.single_action_space = self._evaluator.action_space
        self.single_observation_space = self._observer.space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    @property
    def state(self) -> BatchState:
        """The simulations, for tests and custom terms."""
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
        """The numbers of observations in the units that ``features`` names."""
        return np.asarray(observation) * self._evaluator.scale + self._evaluator.offset

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start all episodes, or those that ``options["reset_mask"]`` marks, a boolean for each.

        Raises:
            ValueError: the mask has another type or shape, or marks nothing; or the seeds are too few or too
                many.
        """
        ids = _masked((options or {}).get("reset_mask"), self.num_envs)
        if seed is not None:
            seeds = [seed + k for k in range(self.num_envs)] if isinstance(seed, int) else seed
            if len(seeds) != self.num_envs:
                raise ValueError(
                    f"seed is a list of {len(seeds)}, and there are {self.num_envs} environments: give one "
                    "number, or a list of a number or None for each"
                )
            for index in ids:
                value = seeds[index]
                if value is not None:
                    self._generators[index] = np.random.Generator(np.random.PCG64(value))
        self._reset(ids)
        self._ended[ids] = False
        return self._observer.all(), {"objects": self._evaluator.objects()}

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Apply one action in each environment, shape (N, A)."""
        done = self.advance(actions)
        info: dict[str, Any] = {"reward_terms": done.reward_terms, "objects": done.objects}
        if self.judges_success:
            info["is_success"] = done.success
        if done.final:
            final = np.full(self.num_envs, None, dtype=object)
            for index, observation in done.final.items():
                final[index] = observation
            info["final_obs"] = final
            info["_final_obs"] = np.array([item is not None for item in final])
        return done.observations, done.rewards, done.terminated, done.truncated, info

    def advance(self, actions: Any) -> Outcome:
        """Apply one action in each environment like ``step``, but without a dictionary for each."""
        state, evaluator = self._state, self._evaluator
        evaluator.act(actions)
        state.step(self.task.frame_skip)
        state.elapsed_steps += 1
        reward, terms = evaluator.reward()
        ended, success, _ = evaluator.terminated()
        if not self._same_step and self._ended.any():
            fresh = np.flatnonzero(self._ended)
            self._reset(fresh)
            for values in (reward, *terms.values()):
                values[fresh] = 0.0
            ended[fresh] = success[fresh] = False
        truncated = (state.elapsed_steps >= self._max_steps) & ~ended
        objects = evaluator.objects()
        observations = self._observer.all()
        final: dict[int, Any] = {}
        over = ended | truncated
        if self._same_step:
            if over.any():
                ids = np.flatnonzero(over)
                final = {int(index): _row(observations, int(index)) for index in ids}
                self._reset(ids)
                observations = self._observer.all()
        else:
            self._ended = over
        return Outcome(observations, reward, ended, truncated, success, final, terms, objects)

    def snapshot(self) -> dict[str, Any]:
        """Return the complete state of the environments as arrays by name.

        Restored into equally constructed environments, they continue bit for bit.
        """
        state = self._state
        arrays: dict[str, Any] = {
            "physics": state.batch.state,
            "action": state.action,
            "last_action": state.last_action,
            "elapsed_steps": state.elapsed_steps,
            "contact_forces": state.contact_forces,
            "ended": self._ended,
            "generators": np.stack([_packed(generator) for generator in self._generators]),
        }
        arrays |= {f"potential.{name}": values for name, values in self._evaluator.potentials.items()}
        varied = {term.parameters.get("field", "") for term in self.task.resets} | set(SERVO_FIELDS)
        for field in sorted(varied - {""}):
            values = state.batch.expanded(field)
            if values is not None:
                arrays[f"model.{field}"] = values
        return {name: np.array(values) for name, values in arrays.items()}

    def restore(self, arrays: Mapping[str, Any]) -> None:
        """Restore a result of ``snapshot``.

        Raises:
            ValueError: it belongs to another task or another number of environments.
        """
        state = self._state
        known = self.snapshot()
        for name, values in known.items():
            if name not in arrays or arrays[name].shape != values.shape:
                raise ValueError(f"the saved environments do not fit: {name} is missing or of another shape")
        state.batch.state[:] = arrays["physics"]
        state.action[:], state.last_action[:] = arrays["action"], arrays["last_action"]
        state.elapsed_steps[:], state.contact_forces[:] = arrays["elapsed_steps"], arrays["contact_forces"]
        self._ended[:] = arrays["ended"]
        for generator, packed in zip(self._generators, arrays["generators"], strict=True):
            _unpack(generator, packed)
        for name in known:
            kind, _, field = name.partition(".")
            if kind == "potential":
                self._evaluator.potentials[field][:] = arrays[name]
            elif kind == "model":
                state.parameter(field)[:] = arrays[name]
        state.step_cache.clear()

    def close_extras(self, **kwargs: Any) -> None:
        """Free the pictures."""
        self._observer.close()

    def _reset(self, ids: IntArray) -> None:
        self._evaluator.reset(ids, [self._generators[index] for index in ids])


def _packed(generator: np.random.Generator) -> Any:
    """Return the state of a PCG64 generator as six 64-bit numbers."""
    own: Any = generator.bit_generator.state
    wide = (own["state"]["state"], own["state"]["inc"])
    halves = [part for number in wide for part in (number >> 64, number & (2**64 - 1))]
    return np.array([*halves, own["has_uint32"], own["uinteger"]], np.uint64)


def _unpack(generator: np.random.Generator, packed: Any) -> None:
    high, low, inc_high, inc_low, has, word = (int(number) for number in packed)
    generator.bit_generator.state = {
        "bit_generator": "PCG64",
        "state": {"state": high << 64 | low, "inc": inc_high << 64 | inc_low},
        "has_uint32": has,
        "uinteger": word,
    }


def _masked(mask: Any, count: int) -> IntArray:
    """Return the environments that a mask selects; all without a mask."""
    if mask is None:
        return np.arange(count)
    given = np.asarray(mask)
    if given.shape != (count,) or given.dtype != np.bool_:
        raise ValueError(
            f"reset_mask is an array of {given.dtype} of shape {given.shape}: give {count} booleans"
        )
    if not given.any():
        raise ValueError("reset_mask marks no environment: mark at least one")
    return np.flatnonzero(given)


def _row(observations: Any, index: int) -> Any:
    if isinstance(observations, dict):
        return {name: value[index].copy() for name, value in observations.items()}
    return observations[index].copy()
