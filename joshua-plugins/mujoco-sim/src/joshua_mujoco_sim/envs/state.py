"""The state of one or many simulations as arrays with a leading axis, so that a term is written once.

``N`` is the number of simulations: 1 for an environment of its own, many for a vectorised one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import mujoco
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class State(Protocol):
    """What terms read and resets write; all arrays are live.

    Terms of observations, rewards and terminations are pure: they compute with ``xp`` and write nothing but
    ``step_cache``, so that one function serves NumPy and JAX.

    Attributes:
        xp: the module that computes with the arrays: ``numpy``, or ``jax.numpy`` for a state made of JAX's.
        model: the compiled model, with its nominal parameters.
        qpos, qvel, ctrl: shapes (N, nq), (N, nv), (N, nu).
        mocap_pos: shape (N, nmocap, 3), m.
        contact_forces: on each body, torque and force, shape (N, nbody, 6); zero rows unless the task asks.
        action, last_action: what the policy wants and wanted before, shape (N, A), in its action space.
        elapsed_steps: steps of the present episodes, shape (N,).
        memory: arrays that a task keeps between steps, by name, each (N, …).
        step_cache: what terms have computed from the present state; emptied whenever it changes.
    """

    xp: Any
    model: mujoco.MjModel
    qpos: FloatArray
    qvel: FloatArray
    ctrl: FloatArray
    mocap_pos: FloatArray
    contact_forces: FloatArray
    action: FloatArray
    last_action: FloatArray
    elapsed_steps: IntArray
    memory: dict[str, FloatArray]
    step_cache: dict[Any, Any]

    @property
    def count(self) -> int:
        """N."""

    def site(self, name: str) -> FloatArray:
        """Positions of a site, shape (N, 3), m; one substep old after a step."""

    def body(self, name: str) -> FloatArray:
        """Positions of a body, shape (N, 3), m; one substep old after a step."""

    def parameter(self, field: str) -> Any:
        """A field of the model with a value for each simulation, (N, …), to be written by resets."""


class Simulations(State, Protocol):
    """A state that can be stepped and reset."""

    def step(self, substeps: int) -> None:
        """Step the physics of all simulations."""

    def reset(self, ids: IntArray, keyframe: int) -> None:
        """Put simulations to a keyframe; -1 for the model's default."""

    def forward(self, ids: IntArray) -> None:
        """Make sites, bodies and contacts current after a reset."""


def square_sum(values: Any) -> Any:
    """Sum of the squares of each row, shape (N,)."""
    return (values * values).sum(axis=1)


class Columns:
    """Where named joints stand in ``qpos`` and ``qvel``; looked up once.

    Args:
        model: the compiled model.
        joints: names of joints with one degree of freedom.
    """

    def __init__(self, model: mujoco.MjModel, joints: Sequence[str]) -> None:
        ids = [model.joint(name).id for name in joints]
        self.qpos: IntArray = model.jnt_qposadr[ids].astype(np.int64)
        self.qvel: IntArray = model.jnt_dofadr[ids].astype(np.int64)


class SingleState:
    """The state of one simulation, N = 1.

    Args:
        model: the compiled model, not shared with anybody.
        action_size: A.
        forces: compute ``contact_forces`` after each step; data: that others step, None for its own.
    """

    xp: Any = np

    def __init__(
        self,
        model: mujoco.MjModel,
        action_size: int,
        forces: bool = False,
        data: mujoco.MjData | None = None,
    ) -> None:
        self.model = model
        self.data = mujoco.MjData(model) if data is None else data
        self.qpos, self.qvel = self.data.qpos[None], self.data.qvel[None]
        self.ctrl = self.data.ctrl[None]
        self.mocap_pos = self.data.mocap_pos[None]
        self.contact_forces = self.data.cfrc_ext[None]
        self.action = np.zeros((1, action_size))
        self.last_action = np.zeros((1, action_size))
        self.elapsed_steps = np.zeros(1, np.int64)
        self.memory: dict[str, FloatArray] = {}
        self.step_cache: dict[Any, Any] = {}
        self._forces = forces
        self._sites: dict[str, FloatArray] = {
            model.site(i).name: self.data.site_xpos[None, i] for i in range(model.nsite)
        }
        self._bodies: dict[str, FloatArray] = {
            model.body(i).name: self.data.xpos[None, i] for i in range(model.nbody)
        }

    @property
    def count(self) -> int:
        """N."""
        return 1

    def site(self, name: str) -> FloatArray:
        """Positions of a site, shape (1, 3)."""
        return self._sites[name]

    def body(self, name: str) -> FloatArray:
        """Positions of a body, shape (1, 3)."""
        return self._bodies[name]

    def parameter(self, field: str) -> Any:
        """A field of the model, shape (1, …)."""
        return getattr(self.model, field)[None]

    def step(self, substeps: int) -> None:
        """Step the physics."""
        mujoco.mj_step(self.model, self.data, substeps)
        if self._forces:
            mujoco.mj_rnePostConstraint(self.model, self.data)
        self.step_cache.clear()

    def reset(self, ids: IntArray, keyframe: int) -> None:
        """Put the simulation to a keyframe; -1 for the model's default."""
        del ids
        if keyframe >= 0:
            mujoco.mj_resetDataKeyframe(self.model, self.data, keyframe)
        else:
            mujoco.mj_resetData(self.model, self.data)

    def forward(self, ids: IntArray) -> None:
        """Make sites, bodies and contacts current after a reset."""
        del ids
        mujoco.mj_forward(self.model, self.data)
        self.step_cache.clear()


class BatchState:
    """The state of N simulations that are stepped on all cores. Needs MuJoCo 4.

    Args:
        model: the compiled model.
        count: N.
        action_size: A.
        threads: cores to use; 0 for all.
        forces: compute ``contact_forces`` after each step.
    """

    xp: Any = np

    def __init__(
        self, model: mujoco.MjModel, count: int, action_size: int, threads: int = 0, forces: bool = False
    ) -> None:
        from mujoco.batch import Batch

        self.model = model
        # contact forces are computed from the data of a whole step, which only a persistent batch keeps
        self.batch: Any = Batch(model, count, threads, persistent=forces)
        self._data = mujoco.MjData(model) if forces else None
        self.qpos, self.qvel = self.batch.bind("qpos"), self.batch.bind("qvel")
        self.ctrl = self.batch.bind("ctrl")
        self.mocap_pos = self.batch.bind("mocap_pos") if model.nmocap else np.zeros((count, 0, 3), np.float64)
        self.contact_forces = np.zeros((count, model.nbody, 6))
        self.action = np.zeros((count, action_size))
        self.last_action = np.zeros((count, action_size))
        self.elapsed_steps = np.zeros(count, np.int64)
        self.memory: dict[str, FloatArray] = {}
        self.step_cache: dict[Any, Any] = {}
        sites, bodies = self.batch.bind("site_xpos"), self.batch.bind("xpos")
        self._sites: dict[str, FloatArray] = {model.site(i).name: sites[:, i] for i in range(model.nsite)}
        self._bodies: dict[str, FloatArray] = {model.body(i).name: bodies[:, i] for i in range(model.nbody)}

    @property
    def count(self) -> int:
        """N."""
        return int(self.batch.nsim)

    def site(self, name: str) -> FloatArray:
        """Positions of a site, shape (N, 3)."""
        return self._sites[name]

    def body(self, name: str) -> FloatArray:
        """Positions of a body, shape (N, 3)."""
        return self._bodies[name]

    def parameter(self, field: str) -> Any:
        """A field of the model with a value for each simulation, shape (N, …)."""
        return self.batch.expand(field)

    def step(self, substeps: int) -> None:
        """Step the physics of all simulations."""
        self.batch.step(nstep=substeps)
        if self._data is not None:
            for index in range(self.count):
                self.batch.get_data(index, self._data)
                mujoco.mj_rnePostConstraint(self.model, self._data)
                self.contact_forces[index] = self._data.cfrc_ext
        self.step_cache.clear()

    def reset(self, ids: IntArray, keyframe: int) -> None:
        """Put simulations to a keyframe; -1 for the model's default."""
        self.batch.reset(ids, keyframe, stage=int(mujoco.mjtStage.mjSTAGE_NONE))

    def forward(self, ids: IntArray) -> None:
        """Make sites, bodies and contacts current after a reset."""
        self.batch.forward(ids)
        self.contact_forces[ids] = 0.0
        self.step_cache.clear()
