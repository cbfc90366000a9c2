"""A handle on an emulated camera."""

from __future__ import annotations

from typing import Any

from joshua_emulator.emulator_process import EmulatorProcess


class EmulatedCamera(EmulatorProcess):
    """An emulator process with one camera; a context manager. The process ends with the one that started it.

    Args:
        width, height: of the pictures, in pixels; fps: frames per second.
        options: further options of the command line by name, such as ``port=8081``, ``seed=3``,
            ``fault=["stall=1,at_s=2"]``.
    """

    def __init__(self, width: int = 640, height: int = 480, fps: float = 30, **options: Any) -> None:
        super().__init__(("camera", "--size", f"{width}x{height}", "--fps", str(fps)), options)

    @property
    def source(self) -> str:
        """Address of the stream, for ``CameraConfig.source``."""
        return str(self.ready["source"])

    @property
    def picture(self) -> str:
        """Address of one picture."""
        return str(self.ready["picture"])

    def sent(self, since: int = 0) -> dict[int, int]:
        """Return when the last byte of each frame was sent: monotonic time in ns by frame number."""
        return {entry["number"]: entry["t_ns"] for entry in self.log("frame", since=since)}
