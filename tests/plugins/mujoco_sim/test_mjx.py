"""The variants for accelerators: MJX accepts and steps them as MuJoCo does. `./test -s mjx` runs these."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest
from joshua_mujoco_sim.catalog import PACKAGED_MODELS, find_packaged

mjx = pytest.importorskip("mujoco.mjx", reason="needs JAX: run ./test -s mjx")

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
    import jax

    jax.config.update("jax_enable_x64", True)  # MuJoCo computes in double precision

    model, data = compiled(name)
    data.ctrl[:] += lead
    on_device, state = mjx.put_model(model), mjx.put_data(model, data)
    step = jax.jit(mjx.step)
    for _ in range(20):
        state = step(on_device, state)
        mujoco.mj_step(model, data)
    assert np.asarray(state.qpos) == pytest.approx(data.qpos, abs=tolerance)


def test_few_contacts_are_computed() -> None:
    """Each is a row of the solver on the accelerator, whether it touches or not."""
    model, data = compiled("so_arm100/pick_place_mjx.xml")
    state = mjx.put_data(model, data)
    contacts = state._impl.contact.dist.shape[0]
    print(f"{contacts} contact slots, {state._impl.efc_J.shape[0]} rows")
    assert contacts <= 40


def test_terms_give_jax_what_they_give_numpy() -> None:
    """Observations, rewards and terminations of each task, traced by JAX, on the same states."""
    import jax
    import jax.numpy as jnp
    from joshua_mujoco_sim.envs import TASKS, TermVectorEnv

    jax.config.update("jax_enable_x64", True)

    class Traced:
        """The arrays of a state as JAX's."""

        xp = jnp

        def __init__(self, arrays, state) -> None:
            self.model, self.count, self.step_cache = state.model, state.count, {}
            self.__dict__ |= {name: value for name, value in arrays.items() if "." not in name}
            self._arrays = arrays

        def site(self, name: str):
            return self._arrays[f"site.{name}"]

        def body(self, name: str):
            return self._arrays[f"body.{name}"]

    fields = ("qpos", "qvel", "ctrl", "mocap_pos", "contact_forces", "action", "last_action")
    for task in TASKS.values():
        many = TermVectorEnv(task, 5)
        many.reset(seed=0)
        chance = np.random.default_rng(0)
        for _ in range(12):
            many.step(chance.uniform(-1, 1, many.action_space.shape))
        state, model = many.state, many.state.model
        arrays = {name: np.array(getattr(state, name)) for name in fields}
        arrays |= {f"site.{model.site(i).name}": state.site(model.site(i).name) for i in range(model.nsite)}
        arrays |= {f"body.{model.body(i).name}": state.body(model.body(i).name) for i in range(model.nbody)}
        made = many.task
        functions: list[Any] = [(mode.function, {}) for mode in made.actions.values()]
        functions += [(term.function, term.parameters) for term in made.observations]
        functions += [(term.function, term.parameters) for term in made.rewards]
        functions += [(term.function, term.parameters) for term in made.terminations]
        functions += [(function, {}) for function in made.objects.values()]

        def everything(arrays, functions=functions, state=state):
            return [function(Traced(arrays, state), **parameters) for function, parameters in functions]

        traced = jax.jit(everything)(arrays)
        for (function, parameters), found in zip(functions, traced, strict=True):
            state.step_cache.clear()
            expected = function(state, **parameters)
            assert np.asarray(found) == pytest.approx(expected, abs=1e-12), function.__name__
