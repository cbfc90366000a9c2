"""The MuJoCo viewer: a window that shows the model and lets the user pull its bodies."""

from __future__ import annotations

import contextlib
import os
import sys
import time
import warnings
from typing import Any

from joshua_mujoco_sim.world import World

#: Refresh rate of the window.
SHOW_RATE_HZ = 60.0

#: Longest time to open a window.
OPEN_TIMEOUT_S = 10.0

_REMEDY = (
    "run it on a desktop, or with a virtual display: xvfb-run -a joshua --config …, "
    "or set mode: OFFSCREEN in simulation"
)


class WindowError(Exception):
    """No window can be opened. The message gives reason and remedy."""


def check_display() -> None:
    """Check for a screen without opening a window. Raises WindowError."""
    if sys.platform == "darwin":
        raise WindowError(
            "on macOS the viewer needs the main thread of mjpython, which no child process has: "
            "choose mode: OFFSCREEN in simulation"
        )
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise WindowError(
            f"no display: neither DISPLAY nor WAYLAND_DISPLAY is set, which the window needs: {_REMEDY}"
        )
    try:
        import glfw
    except ImportError as error:
        raise WindowError(f"the window library is not installed: pip install glfw ({error})") from error
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        started = glfw.init()
    if not started:
        reason = "; ".join(str(warning.message) for warning in caught) or "GLFW gave no reason"
        display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        raise WindowError(f"the display {display} cannot be opened: {reason}: {_REMEDY}")


class Window:
    """The viewer on a world's model.

    Ctrl and the mouse pull bodies, which move by physics.

    Args:
        world: to show.

    Raises:
        WindowError: there is no screen.
    """

    def __init__(self, world: World) -> None:
        check_display()
        import mujoco.viewer

        self._world = world
        model = world.physics.model
        with world.lock:
            self._handle: Any = mujoco.viewer.launch_passive(
                model, world.physics.data, show_left_ui=False, show_right_ui=False
            )
        camera, visual = self._handle.cam, model.vis.global_
        camera.azimuth, camera.elevation = visual.azimuth, visual.elevation
        camera.distance = 1.6 * model.stat.extent
        camera.lookat[:] = model.stat.center
        self._texts_s = 0.0

    @property
    def is_open(self) -> bool:
        """Whether the window is still open."""
        return bool(self._handle.is_running())

    def show(self) -> None:
        """Show the present state and read the user's forces on bodies."""
        now_s = time.monotonic()
        if now_s - self._texts_s > 0.5:
            self._texts_s = now_s
            self._say()
        with self._world.lock:
            self._handle.sync()

    def close(self) -> None:
        """Close the window. Idempotent."""
        with contextlib.suppress(RuntimeError):  # the user has already closed it
            self._handle.close()

    def _say(self) -> None:
        world = self._world
        factor = "paused" if world.paused else f"{world.recent_real_time_factor():.2f}"
        rows = (("real-time factor", factor), ("simulated time", f"{world.physics.time_s:.1f} s"))
        left, right = ("\n".join(column) for column in zip(*rows, strict=True))
        self._handle.set_texts((None, None, left, right))
