"""Many environments of one task on MuJoCo XLA: pure functions that JAX traces.

The task's terms are those of the environments in NumPy; see ``joshua_mujoco_sim.envs.terms``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from joshua_mujoco_sim.catalog import PACKAGED_MODELS
from joshua_mujoco_sim.envs import common_terms as common
from joshua_mujoco_sim.envs.starts import Start
from joshua_mujoco_sim.envs.state import SingleState
from joshua_mujoco_sim.envs.terms import Evaluator, Task
from joshua_mujoco_sim.model_file import load_model
from joshua_training.run_folder import RunError
from mujoco import mjx

#: Arrays of all environments by name, (N, …); parameters and potentials are dictionaries of such.
Carry = dict[str, Any]


class Step(NamedTuple):
    """Result of one step of all environments, arrays of shape (N, …).

    Attributes:
        observations: those that the next action answers, of fresh episodes where one has ended.
        final: of the step itself, before a fresh episode.
    """

    observations: Any
    final: Any
    rewards: Any
    terminated: Any
    truncated: Any
    success: Any


class TracedState:
    """A state of N simulations as terms read it, see ``joshua_mujoco_sim.envs.state.State``; not writable."""

    xp: Any = jnp

    def __init__(self, model: mujoco.MjModel, places: tuple[Mapping[str, int], ...], carry: Carry) -> None:
        self.model = model
        self._sites, self._bodies = places
        self._carry = carry
        self.qpos, self.qvel, self.ctrl = carry["qpos"], carry["qvel"], carry["ctrl"]
        self.mocap_pos, self.contact_forces = carry["mocap_pos"], carry["contact_forces"]
        self.action, self.last_action = carry["action"], carry["last_action"]
        self.elapsed_steps = carry["elapsed_steps"]
        self.memory: dict[str, Any] = {}
        self.step_cache: dict[Any, Any] = {}

    @property
    def count(self) -> int:
        """N."""
        return int(self.qpos.shape[0])

    def site(self, name: str) -> Any:
        """Positions of a site, shape (N, 3)."""
        return self._carry["site_xpos"][:, self._sites[name]]

    def body(self, name: str) -> Any:
        """Positions of a body, shape (N, 3)."""
        return self._carry["xpos"][:, self._bodies[name]]

    def parameter(self, field: str) -> Any:
        """A field of the model with a value for each simulation, (N, …)."""
        return self._carry["parameters"][field]


class KeyDraws:
    """Draws of JAX, by a key for each simulation, which each draw replaces.

    Attributes:
        keys: the present ones, shape (n, 2).
    """

    def __init__(self, keys: Any) -> None:
        self.keys = keys

    def uniform(self, low: float, high: float, shape: tuple[int, ...] = ()) -> Any:
        """See ``joshua_mujoco_sim.envs.starts.Draws``."""
        return self._drawn(lambda key: jax.random.uniform(key, shape, minval=low, maxval=high))

    def normal(self, shape: tuple[int, ...] = ()) -> Any:
        """See ``joshua_mujoco_sim.envs.starts.Draws``."""
        return self._drawn(lambda key: jax.random.normal(key, shape))

    def until(self, propose: Callable[[Any], Any], accept: Callable[[Any], Any], tries: int) -> Any:
        """See ``joshua_mujoco_sim.envs.starts.Draws``."""

        def proceed(carry: Any) -> Any:
            _, _, good, tried = carry
            return ~good.all() & (tried < tries)

        def again(carry: Any) -> Any:
            keys, values, good, tried = carry
            draws = KeyDraws(keys)
            values = _chosen(good, values, propose(draws))
            return _chosen(good, keys, draws.keys), values, good | accept(values), tried + 1

        values = propose(self)
        self.keys, values, _, _ = jax.lax.while_loop(
            proceed, again, (self.keys, values, accept(values), jnp.int32(1))
        )
        return values

    def _drawn(self, draw: Callable[[Any], Any]) -> Any:
        both = jax.vmap(jax.random.split)(self.keys)
        self.keys = both[:, 0]
        return jax.vmap(draw)(both[:, 1])


class MjxEnvironments:
    """N environments of one task on MuJoCo XLA.

    ``reset``, ``step`` and ``advance`` are pure: they take and give the arrays of all environments.

    Args:
        task: terms; its model, or the variant of a packaged model for accelerators, is simulated.
        action_mode: one of the task's, "" for its default.

    Raises:
        RunError: MuJoCo XLA cannot simulate the model, or the task keeps arrays of its own.

    Attributes:
        features, observation_scaling, single_observation_space, single_action_space, metadata: as those of
            ``joshua_mujoco_sim.envs.TermVectorEnv``.
    """

    def __init__(self, task: Task, action_mode: str = "") -> None:
        self.task = task
        period_s = task.frame_skip * load_model(task.model_path).opt.timestep
        model = self._model = load_model(variant_of(task.model_path))
        self.substeps = max(round(period_s / model.opt.timestep), 1)
        state = SingleState(model, task.action_size, task.forces)
        task.prepare(state)
        if state.memory:
            raise RunError(
                f"a term of {task.model_path} keeps {', '.join(state.memory)} in memory, which MuJoCo XLA "
                "does not offer: train with simulator_backend: BACKEND_MUJOCO"
            )
        evaluator = self.evaluator = Evaluator(task, state, action_mode)
        self.features = evaluator.features
        self.observation_scaling = (evaluator.offset, evaluator.scale)
        self.single_observation_space = evaluator.observation_space
        self.single_action_space = evaluator.action_space
        self.metadata = {"render_fps": round(1 / period_s)}
        state.reset(np.zeros(1, np.int64), evaluator.keyframe)
        self._first = {
            name: np.array(getattr(state.data, name)) for name in ("qpos", "qvel", "ctrl", "mocap_pos")
        }
        self._places = (
            {model.site(i).name: i for i in range(model.nsite)},
            {model.body(i).name: i for i in range(model.nbody)},
        )
        try:
            self._on_device, self._data = mjx.put_model(model, impl="jax"), mjx.make_data(model, impl="jax")
        except NotImplementedError as error:
            raise RunError(
                f"MuJoCo XLA cannot simulate {task.model_path}: {error}: simplify the model, or train with "
                "simulator_backend: BACKEND_MUJOCO"
            ) from error

    def reset(self, keys: Any) -> tuple[Carry, Any]:
        """Start all episodes, by a key for each, shape (N, 2); return the arrays and the observations."""
        carry = self._begun(keys)
        return carry, self.evaluator.observed(self._state(carry))

    def step(self, carry: Carry, actions: Any) -> tuple[Carry, Step]:
        """Apply one action in each environment, shape (N, A), and restart episodes that end."""
        carry, step = self.advance(carry, actions)
        over = step.terminated | step.truncated

        def restarted(carry: Carry) -> Carry:
            fresh = self._begun(carry["keys"])
            return dict(jax.tree.map(lambda new, old: _chosen(over, new, old), fresh, carry))

        carry = jax.lax.cond(over.any(), restarted, lambda carry: carry, carry)
        shown = _chosen(over, self.evaluator.observed(self._state(carry)), step.final)
        return carry, step._replace(observations=shown)

    def advance(self, carry: Carry, actions: Any) -> tuple[Carry, Step]:
        """Apply one action in each environment, shape (N, A), and leave episodes that end as they are."""
        evaluator = self.evaluator
        action = evaluator.limited(actions, jnp)
        carry = {**carry, "last_action": carry["action"], "action": action}
        carry["ctrl"] = evaluator.controlled(self._state(carry))
        moving = ("qpos", "qvel", "ctrl", "mocap_pos", "warmstart", "parameters")
        carry |= jax.vmap(self._moved)({name: carry[name] for name in moving})
        carry["elapsed_steps"] = carry["elapsed_steps"] + 1
        state = self._state(carry)
        rewards, _, potentials = evaluator.rewarded(state, carry["potentials"])
        carry["potentials"] = potentials
        ended, success, _ = evaluator.judged(state)
        # MuJoCo itself resets a simulation that diverges; here its numbers end with the episode. Its limit
        # keeps squares finite in single precision
        sound = ~common.diverged(state)
        ended, success = ended | ~sound, success & sound
        rewards = jnp.where(sound, rewards, 0.0)
        final = _chosen(sound, evaluator.observed(state), jnp.float32(0.0))
        truncated = (carry["elapsed_steps"] >= self.task.max_steps) & ~ended
        return carry, Step(final, final, rewards, ended, truncated, success)

    def _state(self, carry: Carry) -> Any:
        return TracedState(self._model, self._places, carry)

    def _moved(self, one: Carry) -> Carry:
        """Return one simulation after the substeps of an action."""
        with jax.default_matmul_precision("highest"):
            model = self._on_device.replace(**one["parameters"])
            data = self._data_of(one).replace(ctrl=one["ctrl"], qacc_warmstart=one["warmstart"])
            data, _ = jax.lax.scan(
                lambda data, _: (mjx.step(model, data), None), data, None, length=self.substeps
            )
            if self.task.forces:
                data = mjx.rne_postconstraint(model, data)
        return {
            "qpos": data.qpos,
            "qvel": data.qvel,
            "warmstart": data.qacc_warmstart,
            "site_xpos": data.site_xpos,
            "xpos": data.xpos,
            "contact_forces": data._impl.cfrc_ext,
        }

    def _data_of(self, one: Carry) -> Any:
        return self._data.replace(**{name: one[name] for name in ("qpos", "qvel", "mocap_pos")})

    def _placed(self, one: Carry) -> Carry:
        """Return where sites and bodies of one simulation are."""
        data = mjx.kinematics(self._on_device, self._data_of(one))
        return {"site_xpos": data.site_xpos, "xpos": data.xpos}

    def _begun(self, keys: Any) -> Carry:
        """Return all environments at starts of episodes."""
        count, evaluator, model = keys.shape[0], self.evaluator, self._model
        first = {name: jnp.tile(values, (count, *(1,) * values.ndim)) for name, values in self._first.items()}
        draws = KeyDraws(keys)
        start = Start(jnp, model, first["qpos"], first["qvel"], first["mocap_pos"], self._nominal)
        begun = evaluator.begun(start, draws)
        carry: Carry = {
            **{"qpos": begun.qpos, "qvel": begun.qvel, "mocap_pos": begun.mocap_pos, "ctrl": first["ctrl"]},
            "parameters": dict(begun.parameters),
            "warmstart": jnp.zeros((count, model.nv)),
            "contact_forces": jnp.zeros((count, model.nbody, 6)),
            "action": jnp.zeros((count, self.task.action_size)),
            "elapsed_steps": jnp.zeros(count, jnp.int32),
            "keys": draws.keys,
        }
        carry |= jax.vmap(self._placed)({name: carry[name] for name in ("qpos", "qvel", "mocap_pos")})
        carry["last_action"] = carry["action"]
        carry["action"] = carry["last_action"] = evaluator.first_action(self._state(carry))
        carry["potentials"] = evaluator.potentials_of(self._state(carry))
        return carry

    def _nominal(self, field: str) -> Any:
        return np.asarray(getattr(self._model, field))


def variant_of(model_path: str) -> str:
    """Return the variant of a packaged model for accelerators; other models are simulated as they are."""
    found = {model.name: model.mjx for model in PACKAGED_MODELS}
    return found.get(model_path) or model_path


def _chosen(rows: Any, one: Any, other: Any) -> Any:
    """Return the rows of one array that are chosen, shape (N,), and else those of another."""
    return jnp.where(rows.reshape(-1, *(1,) * (one.ndim - 1)), one, other)
