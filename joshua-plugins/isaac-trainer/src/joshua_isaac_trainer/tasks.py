"""The tasks of joshua-mujoco-sim on tensors: the same terms observe, reward, end and start episodes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import mujoco
import numpy as np
import torch
from joshua_mujoco_sim.envs.starts import Start
from joshua_mujoco_sim.envs.state import SingleState
from joshua_mujoco_sim.envs.tasks import TASKS
from joshua_mujoco_sim.envs.terms import Evaluator, Task
from joshua_mujoco_sim.model_file import load_model

from joshua_isaac_trainer.tensors import TensorArrays, TensorDraws, rotated


class Readings(Protocol):
    """What a simulator shows of N environments, each in the frame of its own environment."""

    def joints(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Return positions (rad) and speeds (rad/s) of the robot's joints in the model's order, (N, J)."""

    def body(self, name: str) -> tuple[torch.Tensor, torch.Tensor]:
        """Return position (m) and attitude (w, x, y, z) of a body, shapes (N, 3) and (N, 4)."""

    def speed(self, name: str) -> torch.Tensor:
        """Return linear and angular speed of a free body, shape (N, 6)."""


class _NothingKept(dict[Any, Any]):
    """A ``step_cache`` that keeps nothing, because the state changes between any two terms."""

    def __setitem__(self, key: Any, value: Any) -> None:
        del key, value


class TensorState:
    """The state of N environments that a simulator steps; implements ``State`` of joshua-mujoco-sim.

    Args:
        model: compiled, for constants; readings: of the simulator; count: N; action_size: A.
    """

    def __init__(
        self, model: mujoco.MjModel, readings: Readings, count: int, action_size: int, arrays: TensorArrays
    ) -> None:
        self.xp, self.model, self.count = arrays, model, count
        self._readings = readings
        self.ctrl = arrays.zeros((count, model.nu))
        self.action = arrays.zeros((count, action_size))
        self.last_action = arrays.zeros((count, action_size))
        self.mocap_pos = arrays.zeros((count, model.nmocap, 3))
        self.contact_forces = arrays.zeros((count, model.nbody, 6))
        self.elapsed_steps = torch.zeros(count, dtype=torch.long, device=arrays.device)
        self.memory: dict[str, Any] = {}
        self.step_cache: dict[Any, Any] = _NothingKept()
        kinds = [mujoco.mjtJoint(kind) for kind in model.jnt_type]
        self._free = [
            (model.body(model.jnt_bodyid[j]).name, int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j]))
            for j, kind in enumerate(kinds)
            if kind == mujoco.mjtJoint.mjJNT_FREE
        ]

    @property
    def qpos(self) -> torch.Tensor:
        """Positions as in the model, shape (N, nq)."""
        parts = [self._readings.joints()[0]]
        for name, _, _ in self._free:
            parts += self._readings.body(name)
        return torch.cat(parts, dim=1)

    @property
    def qvel(self) -> torch.Tensor:
        """Speeds as in the model, shape (N, nv); those of free bodies in the frame of the environment."""
        speeds = [self._readings.speed(name) for name, _, _ in self._free]
        return torch.cat([self._readings.joints()[1], *speeds], dim=1)

    def site(self, name: str) -> torch.Tensor:
        """Positions of a site, shape (N, 3), m."""
        site = self.model.site(name)
        body = int(self.model.site_bodyid[site.id])
        offset = self.xp.asarray(site.pos)
        mocap = int(self.model.body_mocapid[body])
        if mocap >= 0:
            return self.mocap_pos[:, mocap] + offset
        position, attitude = self._readings.body(self.model.body(body).name)
        return position + rotated(attitude, offset)

    def body(self, name: str) -> torch.Tensor:
        """Positions of a body, shape (N, 3), m."""
        return self._readings.body(name)[0]

    def parameter(self, field: str) -> Any:
        """A field of the model with a value for each simulation; Isaac Lab varies its own."""
        raise NotImplementedError(f"{field} belongs to MuJoCo; Isaac Lab's events vary the physics")


class TensorTask:
    """A task whose terms are computed on tensors.

    Args:
        environment_id: such as ``joshua/SoArm100Reach-v0``; reward_function: "" for the task's first.

    Attributes:
        task: of joshua-mujoco-sim; model: compiled; evaluator: of the same task with NumPy, for its features,
            scales and spaces.
    """

    def __init__(self, environment_id: str, reward_function: str = "") -> None:
        make = TASKS[environment_id]
        self.task: Task = make(reward_function) if reward_function else make()
        self.model: mujoco.MjModel = load_model(self.task.model_path)
        self.evaluator = Evaluator(self.task, SingleState(self.model, self.task.action_size))
        self._mode = next(iter(self.task.actions.values()))
        self._scaling: dict[str, tuple[Any, Any]] = {}
        begin = 0
        for term in self.task.observations:
            end = begin + self.evaluator.features[f"observation.{term.name}"].shape[0]
            self._scaling[term.name] = (self.evaluator.offset[begin:end], self.evaluator.scale[begin:end])
            begin = end
        self._observations = {term.name: term for term in self.task.observations}
        self._rewards = {term.name: term for term in self.task.rewards if term.weight}
        self._ends = {term.name: term for term in self.task.terminations}

    @property
    def step_s(self) -> float:
        """Time of one action."""
        return float(self.task.frame_skip * self.model.opt.timestep)

    @property
    def weights(self) -> dict[str, float]:
        """Weight of each reward term, for one step."""
        return {name: float(term.weight) for name, term in self._rewards.items()}

    @property
    def success_terms(self) -> tuple[str, ...]:
        """Terminations that mean success."""
        return tuple(name for name, term in self._ends.items() if term.success)

    def state(self, readings: Readings, count: int, arrays: TensorArrays) -> TensorState:
        """Make the state of N environments."""
        return TensorState(self.model, readings, count, self.task.action_size, arrays)

    def observe(self, state: TensorState, name: str) -> torch.Tensor:
        """Return a part of the observation, scaled, shape (N, k)."""
        term = self._observations[name]
        offset, scale = (state.xp.asarray(values) for values in self._scaling[name])
        values: torch.Tensor = term.function(state, **term.parameters)
        return (values - offset) / scale

    def reward(self, state: TensorState, name: str, potentials: Mapping[str, torch.Tensor]) -> torch.Tensor:
        """Return a reward term without its weight, shape (N,), by potentials from before the step."""
        term = self._rewards[name]
        value: torch.Tensor = term.function(state, **term.parameters)
        return value - potentials[name] if name in potentials else value

    def potentials(self, state: TensorState) -> dict[str, torch.Tensor]:
        """Return each reward by a potential as it is now, shape (N,)."""
        return {
            name: term.function(state, **term.parameters)
            for name, term in self._rewards.items()
            if term.potential
        }

    def ended(self, state: TensorState, name: str) -> torch.Tensor:
        """Return whether a reason to end an episode holds, shape (N,)."""
        term = self._ends[name]
        reason: torch.Tensor = term.function(state, **term.parameters)
        return reason

    def act(self, state: TensorState, actions: torch.Tensor) -> None:
        """Take the actions of a step, shape (N, A), and write the goals of the joints."""
        space = self.evaluator.action_space
        state.last_action[:] = state.action
        state.action[:] = state.xp.clip(state.xp.asarray(actions), space.low, space.high)
        seen: Any = state  # its positions are read-only
        state.ctrl[:] = self._mode.function(seen)

    def begin(self, count: int, arrays: TensorArrays, generator: torch.Generator) -> Start:
        """Draw the starts of n episodes: ``qpos``, ``qvel`` and ``mocap_pos``."""
        model = self.model
        key = model.key(self.task.keyframe)
        mocap = [model.body(b).pos for b in range(model.nbody) if model.body_mocapid[b] >= 0]
        first = (key.qpos, key.qvel, np.array(mocap).reshape(model.nmocap, 3))
        qpos, qvel, mocap_pos = (arrays.asarray(v).expand(count, *v.shape) for v in first)
        start = Start(arrays, model, qpos, qvel, mocap_pos, lambda field: getattr(model, field))
        draws = TensorDraws(arrays, count, generator)
        for term in self.task.resets:
            start = term.function(start, draws, **term.parameters)
        return start

    def first_goals(self, start: Start) -> torch.Tensor:
        """Return the goals of the joints at the start: those of the keyframe, shape (n, nu)."""
        goals = start.xp.asarray(self.model.key(self.task.keyframe).ctrl)
        rows: torch.Tensor = goals.expand(start.qpos.shape[0], -1)
        return rows
