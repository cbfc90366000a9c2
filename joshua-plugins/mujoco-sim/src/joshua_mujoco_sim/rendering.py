"""Offscreen rendering of a model, with one renderer per camera."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import threading
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from joshua_mujoco_sim.cameras import view
from joshua_mujoco_sim.opengl import LIBRARIES, RenderingError, choose_gl

Picture = npt.NDArray[np.uint8]

#: Largest number of shapes in one picture.
MAX_GEOMS = 10_000

#: Only one renderer is created at a time, because each may enlarge the model's buffer, and only one draws:
#: two threads in Mesa's software renderer have ended a simulation with a segmentation fault.
_busy = threading.Lock()


def _open_context(width: int, height: int) -> Any:
    """Create an OpenGL context and make it current in this thread. Raises RenderingError."""
    name = choose_gl()
    _load_triton()
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
        if getattr(context, "_context", context) is None:  # GLFW only warns
            raise RenderingError("no window could be opened", "")
    except Exception as error:  # each OpenGL binding raises its own exceptions
        raise _unusable(name, error) from error
    return context


def _load_triton() -> None:
    """Load triton, which PyTorch's builds for CUDA bring, before Mesa's software renderer.

    Both contain LLVM. A process that imports a policy, and triton with it, after its first picture ends with
    a segmentation fault. In the other order both work (triton 3.8, Mesa 22.3).
    """
    if importlib.util.find_spec("triton") is None:
        return
    with contextlib.suppress(ImportError):  # a build for another machine, which PyTorch does not use either
        importlib.import_module("triton")


def _unusable(name: str, error: Exception) -> RenderingError:
    other = "osmesa" if name == "egl" else "egl"
    reason = error.problem if isinstance(error, RenderingError) else error
    return RenderingError(
        f"OpenGL cannot be started with MUJOCO_GL={name}: {reason}",
        f"try MUJOCO_GL={other}, which needs the packages {LIBRARIES[other][1]}",
    )


class CameraRenderer:
    """Renderer of one camera. Use it from one thread only, because an OpenGL context belongs to its thread.

    Args:
        model: the compiled model.
        camera: one of its ``camera_names``; width, height: of the picture in pixels.
        shadows: render them; they take two thirds of the time of a small picture.

    Raises:
        ModelError: the model has no such camera; RenderingError: OpenGL is not usable.
    """

    def __init__(
        self, model: mujoco.MjModel, camera: str, width: int, height: int, *, shadows: bool = True
    ) -> None:
        with _busy:
            visual = model.vis.global_
            visual.offwidth, visual.offheight = max(visual.offwidth, width), max(visual.offheight, height)
            self._model = model
            self._gl = _open_context(width, height)
            self._camera = view(model, camera)
            self._scene = mujoco.MjvScene(model, maxgeom=MAX_GEOMS)
            self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
            self._option = mujoco.MjvOption()
            self._perturbation = mujoco.MjvPerturb()
            try:
                self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
            except mujoco.FatalError as error:
                raise _unusable(choose_gl(), error) from error
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._area = mujoco.MjrRect(0, 0, width, height)
        self._pixels: Picture = np.empty((height, width, 3), np.uint8)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the pictures."""
        height, width, colours = self._pixels.shape
        return height, width, colours

    def look(self, data: mujoco.MjData) -> None:
        """Copy the state of the model; fast enough to run while the physics waits."""
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
        """Render the state from ``look``: a new picture of shape (H, W, 3), RGB."""
        with _busy:
            self._gl.make_current()
            mujoco.mjr_render(self._area, self._scene, self._context)
            mujoco.mjr_readPixels(self._pixels, None, self._area, self._context)
        return np.ascontiguousarray(self._pixels[::-1])  # OpenGL counts rows from the bottom

    def close(self) -> None:
        """Free the OpenGL context. Idempotent."""
        gl, self._gl = self._gl, None
        if gl is not None:
            gl.make_current()
            self._context.free()
            gl.free()
