"""Offscreen pictures of a model: the choice of the OpenGL library, and one renderer for each camera."""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

Picture = npt.NDArray[np.uint8]

#: Shapes that one picture may show.
MAX_GEOMS = 10_000

#: How OpenGL is reached without a window on Linux: library and Debian packages, best first.
_LIBRARIES = {
    "egl": ("libEGL.so.1", "libegl1 libgl1-mesa-dri"),
    "osmesa": ("libOSMesa.so.8", "libosmesa6"),
}


#: One renderer is made at a time: each makes sure that the model's buffer is large enough for it.
_making = threading.Lock()


class RenderingError(Exception):
    """No picture can be made; the message says why and what to install."""


def choose_gl() -> str:
    """Chooses how OpenGL is reached without a window; ``MUJOCO_GL`` decides where it is set.

    Returns:
        ``egl`` (a graphics card, or Mesa's software), ``osmesa`` (software), ``glfw`` or ``cgl`` (macOS).

    Raises:
        RenderingError: no library that renders without a window is installed.
    """
    chosen = os.environ.get("MUJOCO_GL", "").lower()
    if chosen in ("egl", "osmesa", "glfw", "cgl"):
        return chosen
    if chosen and chosen != "disabled":
        raise RenderingError(f"MUJOCO_GL={chosen!r} is unknown: set it to egl, osmesa or glfw, or unset it")
    if chosen == "disabled":
        raise RenderingError("MUJOCO_GL=disabled forbids every picture: unset it, or take the cameras out")
    if sys.platform == "darwin":
        return "cgl"
    for name, (library, _) in _LIBRARIES.items():
        try:
            ctypes.CDLL(library)
        except OSError:
            continue
        return name
    packages = " or ".join(package for _, package in _LIBRARIES.values())
    names = " nor ".join(library for library, _ in _LIBRARIES.values())
    raise RenderingError(
        f"no OpenGL library that renders without a window is installed (neither {names}): "
        f"sudo apt install {packages}"
    )


def _open_context(width: int, height: int) -> Any:
    """Makes an OpenGL context and makes it the thread's own. Raises RenderingError."""
    name = choose_gl()
    try:
        if name == "egl":
            from mujoco.egl import GLContext
        elif name == "osmesa":
            from mujoco.osmesa import GLContext
        elif name == "cgl":
            from mujoco.cgl import GLContext
        else:
            from mujoco.glfw import GLContext
        context = GLContext(width, height)
        context.make_current()
    except Exception as error:  # each OpenGL binding raises classes of its own
        other = "osmesa" if name == "egl" else "egl"
        packages = _LIBRARIES[other][1]
        raise RenderingError(
            f"OpenGL does not start by {name}: {error}: try MUJOCO_GL={other}, which needs {packages}"
        ) from error
    return context


class CameraRenderer:
    """Pictures of one camera. Used by one thread only, since an OpenGL context belongs to its thread.

    Args:
        model: the compiled model.
        camera: name of its camera; width, height: of the picture in pixels.

    Raises:
        RenderingError: OpenGL is not usable.
    """

    def __init__(self, model: mujoco.MjModel, camera: str, width: int, height: int) -> None:
        with _making:
            visual = model.vis.global_
            visual.offwidth, visual.offheight = max(visual.offwidth, width), max(visual.offheight, height)
            self._model = model
            self._gl = _open_context(width, height)
            self._camera = mujoco.MjvCamera()
            self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
            self._camera.fixedcamid = model.camera(camera).id
            self._scene = mujoco.MjvScene(model, maxgeom=MAX_GEOMS)
            self._option = mujoco.MjvOption()
            self._perturbation = mujoco.MjvPerturb()
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._area = mujoco.MjrRect(0, 0, width, height)
        self._pixels: Picture = np.empty((height, width, 3), np.uint8)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the pictures."""
        height, width, colours = self._pixels.shape
        return height, width, colours

    def look(self, data: mujoco.MjData) -> None:
        """Takes in the state of the model; short, so that it can be done while the physics waits."""
        mujoco.mjv_updateScene(
            self._model,
            data,
            self._option,
            self._perturbation,
            self._camera,
            mujoco.mjtCatBit.mjCAT_ALL,
            self._scene,
        )

    def draw(self) -> Picture:
        """Draws what ``look`` took in: a new picture of shape (H, W, 3), RGB."""
        self._gl.make_current()
        mujoco.mjr_render(self._area, self._scene, self._context)
        mujoco.mjr_readPixels(self._pixels, None, self._area, self._context)
        return np.ascontiguousarray(self._pixels[::-1])  # OpenGL counts rows from below

    def close(self) -> None:
        """Frees the OpenGL context; a second call does nothing."""
        gl, self._gl = self._gl, None
        if gl is not None:
            gl.make_current()
            self._context.free()
            gl.free()
