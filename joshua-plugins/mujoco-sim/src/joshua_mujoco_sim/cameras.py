"""The cameras of a model, and one more with a view of all of it."""

from __future__ import annotations

import math

import mujoco

from joshua_mujoco_sim.model_file import ModelError

#: Camera that every model has. It stands still in front of the model, slightly above and to the side.
OVERVIEW = "overview"

#: Distance of the overview from the centre of the model, in extents of the model.
_EXTENTS = 1.7

_AZIMUTH_DEG = 135.0
_ELEVATION_DEG = -math.degrees(math.atan2(0.7, math.sqrt(2.0)))


def camera_names(model: mujoco.MjModel) -> list[str]:
    """Return the named cameras of a model, and the overview."""
    names = [model.camera(index).name for index in range(model.ncam)]
    named = [name for name in names if name]
    return named if OVERVIEW in named else [*named, OVERVIEW]


def view(model: mujoco.MjModel, name: str) -> mujoco.MjvCamera:
    """Return a camera of ``camera_names`` for rendering. Raises ModelError for another name."""
    names = camera_names(model)
    if name not in names:
        raise ModelError(f"the model has no camera named {name!r}; it has {', '.join(names)}")
    camera = mujoco.MjvCamera()
    if _is_added(model, name):
        camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        camera.lookat[:] = model.stat.center
        camera.distance = _EXTENTS * model.stat.extent
        camera.azimuth, camera.elevation = _AZIMUTH_DEG, _ELEVATION_DEG
        return camera
    camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
    camera.fixedcamid = model.camera(name).id
    return camera


def field_of_view_rad(model: mujoco.MjModel, name: str) -> float:
    """Return the vertical field of view of one of ``camera_names``."""
    degrees = model.vis.global_.fovy if _is_added(model, name) else model.camera(name).fovy[0]
    return math.radians(float(degrees))


def _is_added(model: mujoco.MjModel, name: str) -> bool:
    return name == OVERVIEW and mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, name) < 0
