"""The variants for accelerators: MJX accepts and steps them as MuJoCo does. `./test -s mjx` runs these."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest
from joshua_mujoco_sim.catalog import PACKAGED_MODELS, find_packaged
from joshua_mujoco_sim.envs import TASKS, TermVectorEnv
from joshua_mujoco_sim.envs.starts import Start
from joshua_mujoco_sim.plugin import ENVIRONMENTS

mjx = pytest.importorskip("mujoco.mjx", reason="needs JAX: run ./test -s mjx")
jax = pytest.importorskip("jax")
jnp = pytest.importorskip("jax.numpy")

VARIANTS = [model.mjx for model in PACKAGED_MODELS if model.mjx]


def compiled(name: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    path = find_packaged(name)
    assert path is not None
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    return model, data


@pytest.mark.parametrize("name", VARIANTS)
def test_variant_is_accepted(name: str) -> None:
    model, data = compiled(name)
    mjx.put_data(model, data)
    assert mjx.put_model(model).nu == model.nu


@pytest.mark.parametrize(
    ("name", "lead", "tolerance"),
    [
        ("so_arm100/so_arm100_mjx.xml", 0.001, 1e-9),
        ("so_arm100/so_arm100_mjx.xml", 0.3, 1e-9),  # saturates every servo
        ("ant/ant_mjx.xml", 0.001, 1e-4),
    ],
)
def test_variant_moves_as_in_mujoco(name: str, lead: float, tolerance: float) -> None:
    jax.config.update("jax_enable_x64", True)  # MuJoCo computes in double precision

    model, data = compiled(name)
    data.ctrl[:] += lead
    on_device, state = mjx.put_model(model), mjx.put_data(model, data)
    step = jax.jit(mjx.step)
    for _ in range(20):
        state = step(on_device, state)
        mujoco.mj_step(model, data)
    assert np.asarray(state.qpos) == pytest.approx(data.qpos, abs=tolerance)


@pytest.mark.parametrize("cone", ["PYRAMIDAL", "ELLIPTIC"])
def test_the_feet_of_the_ant_land_as_in_mujoco(cone: str) -> None:
    """Each step starts from MuJoCo's state, through two landings; ``ant_mjx.xml`` says why they may differ.

    With an elliptic cone all steps agree. With the pyramidal one of the model, those do in which no shin that
    touches the floor is steeper than 60 degrees.
    """
    jax.config.update("jax_enable_x64", True)
    model, data = compiled("ant/ant_mjx.xml")
    model.opt.cone = getattr(mujoco.mjtCone, f"mjCONE_{cone}")
    on_device, state, step = mjx.put_model(model), mjx.put_data(model, data), jax.jit(mjx.step)
    chance, touching, apart = np.random.default_rng(0), 0, 0
    for count in range(60):
        if count % 5 == 0:
            data.ctrl[:] = chance.uniform(-1.0, 1.0, model.nu)
        now = {name: jnp.asarray(getattr(data, name)) for name in ("qpos", "qvel", "ctrl", "qacc_warmstart")}
        found = step(on_device, state.replace(**now))
        mujoco.mj_step(model, data)
        axes = data.geom_xmat.reshape(-1, 3, 3)[:, :, 2]
        steep = any(np.hypot(*axes[geom, :2]) < 0.5 for geom in data.contact.geom[:, 1])
        touching += data.ncon > 0
        if cone == "ELLIPTIC" or not steep:
            assert np.asarray(found.qvel) == pytest.approx(data.qvel, abs=1e-5)
        elif np.abs(np.asarray(found.qvel) - data.qvel).max() > 0.01:
            apart += 1
    assert touching >= 8
    assert (apart > 0) == (cone == "PYRAMIDAL"), "MJX aligns the friction of steep capsules as MuJoCo now"


def test_few_contacts_are_computed() -> None:
    """Each is a row of the solver on the accelerator, whether it touches or not."""
    model, data = compiled("so_arm100/pick_place_mjx.xml")
    state = mjx.put_data(model, data)
    contacts = state._impl.contact.dist.shape[0]
    print(f"{contacts} contact slots, {state._impl.efc_J.shape[0]} rows")
    assert contacts <= 40


OFFERS = [(offer.id, reward) for offer in ENVIRONMENTS for reward in offer.rewards]


class Traced:
    """The arrays of a state as JAX's."""

    xp = jnp

    def __init__(self, arrays: dict[str, Any], state: Any) -> None:
        self.model, self.count, self.step_cache = state.model, state.count, {}
        self.__dict__ |= {name: value for name, value in arrays.items() if "." not in name}
        self._arrays = arrays

    def site(self, name: str) -> Any:
        return self._arrays[f"site.{name}"]

    def body(self, name: str) -> Any:
        return self._arrays[f"body.{name}"]


@pytest.mark.parametrize(("name", "reward"), OFFERS)
def test_terms_give_jax_what_they_give_numpy(name: str, reward: str) -> None:
    """Actions, observations, rewards and ends, traced by JAX, on the same states: alone and put together."""
    jax.config.update("jax_enable_x64", True)
    fields = ("qpos", "qvel", "ctrl", "mocap_pos", "contact_forces", "action", "last_action", "elapsed_steps")
    many = TermVectorEnv(TASKS[name], 5, reward_function=reward)
    many.reset(seed=0)
    chance = np.random.default_rng(0)
    for _ in range(12):
        many.step(chance.uniform(-1, 1, many.action_space.shape))
    state, model, task, evaluator = many.state, many.state.model, many.task, many._evaluator
    arrays = {name: np.array(getattr(state, name)) for name in fields}
    arrays |= {f"site.{model.site(i).name}": state.site(model.site(i).name) for i in range(model.nsite)}
    arrays |= {f"body.{model.body(i).name}": state.body(model.body(i).name) for i in range(model.nbody)}
    potentials = {name: values - 0.1 for name, values in evaluator.potentials.items()}
    functions: list[Any] = [(mode.function, {}) for mode in task.actions.values()]
    functions += [(mode.start, {}) for mode in task.actions.values() if mode.start]
    functions += [(term.function, term.parameters) for term in task.observations]
    functions += [(term.function, term.parameters) for term in task.rewards]
    functions += [(term.function, term.parameters) for term in task.terminations]
    functions += [(function, {}) for function in task.objects.values()]
    functions += [
        (evaluator.controlled, {}),
        (evaluator.observed, {}),
        (evaluator.rewarded, {"potentials": potentials}),
        (evaluator.judged, {}),
        (evaluator.first_action, {}),
        (evaluator.potentials_of, {}),
    ]

    def everything(arrays: dict[str, Any]) -> list[Any]:
        return [function(Traced(arrays, state), **parameters) for function, parameters in functions]

    traced = jax.jit(everything)(arrays)
    for (function, parameters), found in zip(functions, traced, strict=True):
        state.step_cache.clear()
        expected = jax.tree.leaves(function(state, **parameters))
        for one, other in zip(jax.tree.leaves(found), expected, strict=True):
            assert np.asarray(one) == pytest.approx(other, abs=1e-12), function.__name__


class Table:
    """Draws that were made before, the same for NumPy and JAX: numbers from 0 to 1, one after the other."""

    def __init__(self, xp: Any, numbers: Any) -> None:
        self._xp, self._numbers, self._next = xp, numbers, 0

    def uniform(self, low: float, high: float, shape: tuple[int, ...] = ()) -> Any:
        size = int(np.prod(shape))
        taken = self._numbers[:, self._next : self._next + size].reshape(-1, *shape)
        self._next += size
        return low + (high - low) * taken

    def normal(self, shape: tuple[int, ...] = ()) -> Any:
        return self.uniform(-2.0, 2.0, shape)

    def until(self, propose: Any, accept: Any, tries: int) -> Any:
        values = propose(self)
        for _ in range(min(tries, 6) - 1):
            values = self._xp.where(accept(values)[:, None], values, propose(self))
        return values


@pytest.mark.parametrize("name", list(TASKS))
def test_starts_give_jax_what_they_give_numpy(name: str) -> None:
    """Resets and randomised physics, traced by JAX, from the same random numbers."""
    jax.config.update("jax_enable_x64", True)
    many = TermVectorEnv(TASKS[name], 5, randomise=True)
    state, evaluator = many.state, many._evaluator
    numbers = np.random.default_rng(3).uniform(size=(5, 80))

    def begun(xp: Any, numbers: Any) -> Any:
        qpos, qvel, mocap_pos = (
            xp.asarray(np.array(values)) for values in (state.qpos, state.qvel, state.mocap_pos)
        )
        fresh = Start(xp, state.model, qpos, qvel, mocap_pos, evaluator._nominal_of)
        start = evaluator.begun(fresh, Table(xp, numbers))
        return start.qpos, start.qvel, start.mocap_pos, dict(start.parameters)

    expected = begun(np, numbers)
    found = jax.jit(lambda numbers: begun(jnp, numbers))(numbers)
    assert expected[3].keys() == found[3].keys()
    assert len(expected[3]) == len({t.parameters.get("field") for t in TASKS[name]().randomisation}) + (
        1 if "SoArm" in name else 0  # one term varies both gain and bias of a servo
    )
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        assert np.asarray(one) == pytest.approx(other, abs=1e-12)
    for varied in (expected[0], *expected[3].values()):
        assert np.ptp(varied, axis=0).any(), "each simulation starts differently"
