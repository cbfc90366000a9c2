"""The variants for accelerators: MJX accepts and steps them as MuJoCo does. `./test -s mjx` runs these."""

from __future__ import annotations

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


@pytest.mark.parametrize("name", ["so_arm100/so_arm100_mjx.xml", "ant/ant_mjx.xml"])
def test_variant_moves_as_in_mujoco(name: str) -> None:
    import jax

    jax.config.update("jax_enable_x64", True)  # MuJoCo computes in double precision

    model, data = compiled(name)
    data.ctrl[:] += 0.001  # far from saturation, which newer releases of MuJoCo treat differently
    on_device, state = mjx.put_model(model), mjx.put_data(model, data)
    step = jax.jit(mjx.step)
    for _ in range(20):
        state = step(on_device, state)
        mujoco.mj_step(model, data)
    assert np.asarray(state.qpos) == pytest.approx(data.qpos, abs=1e-4)
