"""The node of a camera: a sensor node with statistics, a last picture and a window."""

from __future__ import annotations

import os
import re
import time
from pathlib import Path

from joshua.api import NodeContext, Reading
from joshua.api.clocks import witness
from joshua.api.files import create_private, make_private
from joshua.api.nodes import SensorNode
from joshua.tools import log_directory
from joshua_preview import Preview, display_problem

from joshua_camera.camera import OpenCvCamera
from joshua_camera.figures import Figures
from joshua_camera.picture import Picture

FIGURES_PERIOD_S = 1.0

#: Share of the pictures that may be damaged before MODE_TEST fails a camera.
DAMAGED_SHARE = 0.01
RATE_TOLERANCE = 0.1

#: Standard deviation of a picture's pixels below which it shows nothing.
LEAST_SPREAD = 1.5


class CameraNode(SensorNode):
    """Publishes a camera's pictures.

    In MODE_TEST it logs statistics each second and saves the last picture beside the log; with
    ``display`` it shows the pictures in a window.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._testing = context.spec.facts.testing
        self._preview: Preview | None = None
        self._last_picture: Picture | None = None

    @property
    def camera(self) -> OpenCvCamera:
        """The camera that this node drives."""
        assert isinstance(self._sensor, OpenCvCamera)
        return self._sensor

    def configure(self) -> None:
        """Open the camera, declare topics, and report settings that the camera did not apply."""
        super().configure()
        for text in self.camera.warnings:
            self.context.warn(text)
        if self.camera.settings.display:
            self._open_preview()
        self.context.create_timer(FIGURES_PERIOD_S, self._log_figures, name="figures")

    def deactivate(self) -> None:
        """Abort a running connection attempt."""
        if isinstance(self._sensor, OpenCvCamera):
            self._sensor.cancel()
        if self._preview is not None:
            self._preview.close()

    def observe(self, reading: Reading) -> None:
        """Keep the newest picture for the window and the end of a test."""
        self._last_picture = reading.data
        if self._preview is not None:
            self._preview.show(reading.data.as_rgb)

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Return the rows of a sensor, then rate, settings, losses, latency and the last picture."""
        rows = super().test_results()
        if not self._testing or not isinstance(self._sensor, OpenCvCamera):
            return rows
        camera, figures = self._sensor, self._sensor.figures
        settings = camera.settings
        kept = not camera.refused
        rows.append(_rate(figures, settings.fps))
        rows.append(("settings kept", kept, "all" if kept else "; ".join(camera.refused)))
        rows.append(_losses(figures))
        rows.append(("latency", figures.delivered > 0, _latency(figures)))
        if figures.exposure:
            rows.append(("exposure", True, figures.exposure))
        rows += [self._content(), self._save_picture()]
        return rows

    def _log_figures(self) -> None:
        line = self.camera.figures.line()
        if self._testing:
            self.context.log.info(line)
        else:
            self.context.log.debug(line)

    def _open_preview(self) -> None:
        problem = display_problem()
        if problem:
            self.context.warn(problem)
            return
        spec = self.context.spec
        self._preview = Preview(spec.full_name, lambda: self.camera.figures.line(), self.context.log.warning)
        self._preview.open()

    def _content(self) -> tuple[str, bool, str]:
        pixels = self._last_picture.as_rgb() if self._last_picture is not None else None
        if pixels is None:
            return ("picture has content", False, "none received")
        level, spread = float(pixels.mean()), float(pixels.std())
        if spread < LEAST_SPREAD:
            hint = "check whether the lens is covered or the exposure is wrong"
            return ("picture has content", False, f"every pixel is near {level:.0f} of 255: {hint}")
        return ("picture has content", True, f"mean {level:.0f} of 255, spread {spread:.0f}")

    def _save_picture(self) -> tuple[str, bool, str]:
        if self._last_picture is None:
            return ("last picture", False, "none received")
        name = re.sub(r"[^A-Za-z0-9_]+", "_", self.context.spec.full_name).strip("_")
        path = log_directory(os.environ) / f"{name}-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.jpg"
        try:
            make_private(path.parent)
            create_private(path)
            path.write_bytes(self._last_picture.as_jpeg())
        except OSError as error:
            return ("last picture", False, f"cannot be written to {path}: {(error.strerror or '').lower()}")
        return ("last picture", True, str(Path(path)))


def _rate(figures: Figures, wanted_hz: float) -> tuple[str, bool, str]:
    first_ns, last_ns = figures.span_ns
    ran_ns = last_ns - first_ns - 1e9 * witness().missed_s(first_ns / 1e9, last_ns / 1e9)
    most_hz = figures.fps * (last_ns - first_ns) / ran_ns if ran_ns > 0 else figures.fps
    slow, fast = wanted_hz * (1 - RATE_TOLERANCE), wanted_hz * (1 + RATE_TOLERANCE)
    passed = most_hz >= slow and figures.fps <= fast  # a system stall is not the camera's fault
    hint = "" if passed else ": many cameras are slower in poor light and on shared USB hubs"
    return ("frame rate", passed, f"{figures.fps:.4g} Hz of {wanted_hz:g} Hz{hint}")


def _losses(figures: Figures) -> tuple[str, bool, str]:
    passed = figures.received > 0 and figures.damaged <= DAMAGED_SHARE * figures.received
    lost = f"{figures.dropped} dropped, {figures.stale} stale, {figures.damaged} damaged"
    return ("pictures whole", passed, f"{figures.received} received, {lost}")


def _latency(figures: Figures) -> str:
    if not figures.delivered:
        return "no picture was delivered"
    return f"median {figures.latency_p50_s * 1e3:.1f} ms, 99 % within {figures.latency_p99_s * 1e3:.1f} ms"
