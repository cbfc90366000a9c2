"""Choice of the OpenGL library before MuJoCo is imported, because MuJoCo rejects an unknown ``MUJOCO_GL``."""

from __future__ import annotations

import ctypes
import os
import sys

#: OpenGL libraries without a window on Linux, with their Debian packages, best first.
LIBRARIES = {
    "egl": ("libEGL.so.1", "libegl1 libgl1-mesa-dri"),
    "osmesa": ("libOSMesa.so.8", "libosmesa6"),
}

_BACKENDS = ("glfw", "cgl") if sys.platform == "darwin" else ("egl", "osmesa", "glfw", "glx")
_ON = ("", "enable", "enabled", "on", "true", "1")
_OFF = ("disable", "disabled", "off", "false", "0")


class RenderingError(Exception):
    """Rendering is not possible.

    Args:
        problem: what is wrong; remedy: an imperative.
    """

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(f"{problem}: {remedy}")
        self.problem, self.remedy = problem, remedy


def check_variable() -> str:
    """Return the value of ``MUJOCO_GL``: a library, "" or ``disabled``. Raises RenderingError."""
    value = os.environ.get("MUJOCO_GL", "").lower().strip()
    if value in _ON:
        return ""
    if value in _OFF:
        return "disabled"
    if value not in _BACKENDS:
        raise RenderingError(
            f"the environment variable MUJOCO_GL is {value!r}, which MuJoCo does not know",
            f"unset MUJOCO_GL, or set it to {' or '.join(_BACKENDS)}",
        )
    return "glfw" if value == "glx" else value


def choose_gl() -> str:
    """Choose the OpenGL library; ``MUJOCO_GL`` takes precedence.

    Returns:
        ``egl`` (a graphics card, or Mesa's software), ``osmesa`` (software), ``glfw`` or ``cgl`` (macOS).

    Raises:
        RenderingError: ``MUJOCO_GL`` disables rendering, or no library works here.
    """
    chosen = check_variable()
    if chosen == "disabled":
        raise RenderingError(
            f"MUJOCO_GL={os.environ['MUJOCO_GL']} disables rendering", "unset it, or remove the cameras"
        )
    if chosen == "glfw" and sys.platform != "darwin" and not has_display():
        raise RenderingError(
            "MUJOCO_GL=glfw draws in a window, and neither DISPLAY nor WAYLAND_DISPLAY names a display",
            "unset MUJOCO_GL, or set MUJOCO_GL=egl",
        )
    if chosen:
        return chosen
    if sys.platform == "darwin":
        return "cgl"
    for name, (library, _) in LIBRARIES.items():
        try:
            ctypes.CDLL(library)
        except OSError:
            continue
        return name
    packages = " or ".join(package for _, package in LIBRARIES.values())
    names = " nor ".join(library for library, _ in LIBRARIES.values())
    raise RenderingError(
        f"no OpenGL library that draws without a window is installed (neither {names})",
        f"run sudo apt install {packages}",
    )


def has_display() -> bool:
    """Return whether this process has a display."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
