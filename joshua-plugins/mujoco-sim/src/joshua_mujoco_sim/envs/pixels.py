"""Observations of an environment: state, camera pictures, or both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from gymnasium import spaces

from joshua_mujoco_sim.cameras import camera_names
from joshua_mujoco_sim.envs.state import State
from joshua_mujoco_sim.envs.terms import Evaluator
from joshua_mujoco_sim.rendering import CameraRenderer

OBSERVATION_MODES = ("state", "pixels", "both")

#: Width and height of pictures in pixels, unless the caller chooses others.
SIZE = (320, 240)


class Observer:
    """Computes the observations of an environment.

    ``state`` is one array. ``pixels`` is a dictionary of pictures by camera name. ``both`` adds the array as
    ``state``.

    Args:
        evaluator: of the numbers; state: of the simulations.
        mode: one of ``OBSERVATION_MODES``; cameras: that are shown; () for the task's own.
        width, height: of the pictures in pixels; shadows: draw them, which takes most of the time.

    Raises:
        ValueError: the mode or a camera is unknown; lists those that are known.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        state: State,
        mode: str,
        cameras: Sequence[str],
        width: int,
        height: int,
        shadows: bool,
    ) -> None:
        if mode not in OBSERVATION_MODES:
            raise ValueError(f"observation_mode {mode!r} is unknown: choose {', '.join(OBSERVATION_MODES)}")
        model = state.model
        known = camera_names(model)
        for camera in cameras:
            if camera not in known:
                raise ValueError(f"the model has no camera {camera!r}: choose {', '.join(known)}")
        if mode == "state" and cameras:
            raise ValueError("cameras have no effect with observation_mode 'state': choose pixels or both")
        self._evaluator, self._state, self._mode = evaluator, state, mode
        self._cameras = tuple(cameras) if mode != "state" else ()
        self._size, self._shadows = (width, height), shadows
        self._renderers: dict[str, CameraRenderer] = {}
        self._data: mujoco.MjData | None = None
        picture = spaces.Box(0, 255, (height, width, 3), np.uint8)
        shown: dict[str, spaces.Space[Any]] = dict.fromkeys(self._cameras, picture)
        if mode == "both":
            shown["state"] = evaluator.observation_space
        self.space: spaces.Space[Any] = spaces.Dict(shown) if shown else evaluator.observation_space

    def all(self) -> Any:
        """Observations of all simulations, with a leading axis."""
        if self._mode == "state":
            return self._evaluator.observation()
        shown = {camera: self._pictures(camera) for camera in self._cameras}
        return shown | ({"state": self._evaluator.observation()} if self._mode == "both" else {})

    def _pictures(self, camera: str) -> Any:
        state, (width, height) = self._state, self._size
        if camera not in self._renderers:
            made = CameraRenderer(state.model, camera, width, height, shadows=self._shadows)
            self._renderers[camera] = made
        if self._data is None:
            self._data = mujoco.MjData(state.model)
        renderer, data = self._renderers[camera], self._data
        pictures = np.empty((state.count, height, width, 3), np.uint8)
        for index in range(state.count):
            data.qpos[:] = state.qpos[index]
            data.mocap_pos[:] = state.mocap_pos[index]
            mujoco.mj_kinematics(state.model, data)
            mujoco.mj_comPos(state.model, data)  # tracking cameras look at centres of mass
            mujoco.mj_camlight(state.model, data)
            renderer.look(data)
            pictures[index] = renderer.draw()
        return pictures

    def close(self) -> None:
        """Free the pictures. Idempotent."""
        for renderer in self._renderers.values():
            renderer.close()
        self._renderers = {}


def refuse_unseen(mode: str, width: int, height: int, shadows: bool) -> None:
    """Refuse what concerns pictures where none is drawn.

    Raises:
        ValueError: names it.
    """
    given = {"shadows have": shadows, "width has": width != SIZE[0], "height has": height != SIZE[1]}
    for name, is_given in given.items():
        if mode == "state" and is_given:
            raise ValueError(f"{name} no effect with observation_mode 'state': choose pixels or both")


def first(observation: Any) -> Any:
    """Return the observation of the first simulation only."""
    if isinstance(observation, dict):
        return {name: value[0] for name, value in observation.items()}
    return observation[0]
