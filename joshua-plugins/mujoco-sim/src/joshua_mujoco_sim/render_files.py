"""Pictures in files, rendered at exact simulated times, so a repeated run gives the same files."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any

from joshua.tools import install
from PIL import Image

from joshua_mujoco_sim.opengl import RenderingError
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.rendering import CameraRenderer, Picture
from joshua_mujoco_sim.settings_parts import Render
from joshua_mujoco_sim.world import World


class PictureWriter(ABC):
    """Writes the pictures of one camera, in order."""

    @abstractmethod
    def write(self, picture: Picture) -> None:
        """Write one picture of shape (H, W, 3), RGB. Raises OSError."""

    def close(self) -> None:
        """Complete the file. Raises OSError."""


class PngWriter(PictureWriter):
    """Writes one PNG file per picture, numbered from 0."""

    def __init__(self, pattern: Path) -> None:
        self._pattern = pattern
        self._number = 0

    def write(self, picture: Picture) -> None:
        """Write one file."""
        name = self._pattern.name % self._number
        Image.fromarray(picture).save(self._pattern.with_name(name), format="PNG", compress_level=1)
        self._number += 1


class VideoWriter(PictureWriter):
    """Writes H.264 in an MP4 file, which every player supports.

    Raises:
        RenderingError: the library for videos is not installed; OSError: the file cannot be written.
    """

    def __init__(self, path: Path, width: int, height: int, fps: int) -> None:
        try:
            import av
        except ImportError as error:
            raise RenderingError(
                f"{path.name} needs the library for videos, which is not installed",
                f"run {install('joshua-mujoco-sim', 'video')}, or name PNG files",
            ) from error
        self._frame: Any = av.VideoFrame
        self._fault: type[Exception] = av.FFmpegError
        self._container: Any = av.open(str(path), "w")
        self._stream: Any = self._container.add_stream("libx264", rate=fps)
        self._stream.width, self._stream.height = width - width % 2, height - height % 2
        self._stream.pix_fmt = "yuv420p"
        # one thread, so the output is reproducible
        self._stream.options = {"preset": "veryfast", "crf": "20", "threads": "1"}
        try:
            # Write the header now, because PyAV crashes if it continues after a failed header write.
            self._container.start_encoding()
        except self._fault as error:
            raise OSError(f"{path}: {error}") from error

    def write(self, picture: Picture) -> None:
        """Encode one picture."""
        even = picture[: self._stream.height, : self._stream.width]
        self._encode(self._frame.from_ndarray(even, format="rgb24"))

    def close(self) -> None:
        """Write the remaining data and the index."""
        try:
            self._encode(None)
        finally:
            self._close()

    def _encode(self, frame: Any) -> None:
        try:
            for packet in self._stream.encode(frame):
                self._container.mux(packet)
        except self._fault as error:
            raise OSError(str(error)) from error

    def _close(self) -> None:
        try:
            self._container.close()
        except self._fault as error:
            raise OSError(str(error)) from error


class RenderFile:
    """Renders one camera to a file. The physics waits for each picture, so none is late or missing.

    Args:
        world: to render; render: camera, size, rate and file.

    Raises:
        RenderingError: a library is missing; OSError: the folder cannot be made.
    """

    def __init__(self, world: World, render: Render) -> None:
        path = Path(render.output)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._render = render
        self._model = world.physics.model
        self._writer: PictureWriter = (
            PngWriter(path)
            if path.suffix == ".png"
            else VideoWriter(path, render.width, render.height, render.fps)
        )
        self._renderer: CameraRenderer | None = None
        self.error = ""
        self.count = 0
        self._frame: int | None = None
        self._last_s = 0.0
        self._world = world
        self._closed = False
        self._unhook: Callable[[], None] | None = None

    @property
    def output(self) -> str:
        """The file, or the pattern of the file names."""
        return self._render.output

    def begin(self) -> None:
        """Start rendering, after ``open``."""
        self._unhook = self._world.before_step(self._look)

    def close(self) -> None:
        """Complete the file; after the physics has stopped."""
        if self._unhook is not None:
            self._unhook()
        self._closed = True
        try:
            self._writer.close()
        except OSError as error:
            self.error = self.error or f"{self._render.output}: {error}"

    def open(self) -> None:
        """Create the renderer on the physics thread, because OpenGL binds it to that thread."""
        size = self._render
        try:
            self._renderer = CameraRenderer(
                self._model, size.camera, size.width, size.height, shadows=self._world.settings.shadows
            )
        except RenderingError as error:
            self.error = f"{self._render.output}: {error}"

    def _look(self, physics: Physics) -> None:
        rate = self._render.fps
        if self._frame is None or physics.time_s < self._last_s:  # at first, and after a reset
            self._frame = math.ceil(physics.time_s * rate - 1e-6)
        self._last_s = physics.time_s
        if self.error or self._renderer is None or physics.time_s < self._frame / rate - 1e-9:
            return
        self._renderer.look(physics.data)
        self._frame += 1
        self._world.defer(self._draw)

    def _draw(self) -> None:
        if self._renderer is None or self._closed:
            return
        try:
            self._writer.write(self._renderer.draw())
            self.count += 1
        except (RenderingError, OSError) as error:
            self.error = f"{self._render.output}: {error}"
