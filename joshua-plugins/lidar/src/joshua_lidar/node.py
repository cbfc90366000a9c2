"""The node of a laser scanner: a sensor node with statistics, a picture of the last scan and a window."""

from __future__ import annotations

import os
import re
import time

from joshua.api import NodeContext, Reading
from joshua.api.files import create_private, make_private
from joshua.api.nodes import SensorNode
from joshua.tools import log_directory
from joshua_preview import Preview, display_problem

from joshua_lidar.assembly import Scan
from joshua_lidar.drawing import terminal_view, top_view
from joshua_lidar.figures import DAMAGED_SHARE, Figures
from joshua_lidar.lidar import SerialLidar
from joshua_lidar.models import Model

FIGURES_PERIOD_S = 1.0

#: Criteria of MODE_TEST: relative deviation of the turn rate from nominal, and measurements per turn and
#: measured beams as shares of all beams.
TURN_TOLERANCE = 0.4
LEAST_POINTS = 0.6
LEAST_COVERAGE = 0.5

Row = tuple[str, bool, str]


class LidarNode(SensorNode):
    """Publishes a laser scanner's scans.

    In MODE_TEST it logs statistics each second, draws the last scan into the log and saves a picture of it
    beside the log; with ``display`` it shows the scans in a window.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._testing = context.spec.facts.testing
        self._preview: Preview | None = None
        self._last_scan: Scan | None = None

    @property
    def lidar(self) -> SerialLidar:
        """The scanner that this node drives."""
        assert isinstance(self._sensor, SerialLidar)
        return self._sensor

    def configure(self) -> None:
        """Start the scanner, declare topics, and say which scanner it is."""
        super().configure()
        self.context.log.info(self.lidar.facts)
        for text in self.lidar.warnings:
            self.context.warn(text)
        if self.lidar.settings.display:
            self._open_preview()
        self.context.create_timer(FIGURES_PERIOD_S, self._log_figures, name="figures")

    def deactivate(self) -> None:
        """Abort a running connection attempt."""
        if isinstance(self._sensor, SerialLidar):
            self._sensor.cancel()
        if self._preview is not None:
            self._preview.close()

    def observe(self, reading: Reading) -> None:
        """Keep the newest scan for the window and the end of a test."""
        scan: Scan = reading.data
        self._last_scan = scan
        beams = self.lidar.beams
        if self._preview is not None and beams is not None:
            self._preview.show(lambda: top_view(scan, beams))

    def test_results(self) -> list[Row]:
        """Return the rows of a sensor, then scanner, turns, points, coverage, line and the last scan."""
        rows = super().test_results()
        if not self._testing or not isinstance(self._sensor, SerialLidar):
            return rows
        lidar, figures = self._sensor, self._sensor.figures
        rows.append(("scanner", bool(lidar.facts), lidar.facts or "none found"))
        if lidar.model is not None and lidar.beams is not None:
            rows += judge(figures, lidar.model, lidar.model.beams_in(lidar.settings.scan_mode))
            rows.append(self._save_picture())
        return rows

    def _log_figures(self) -> None:
        line = self.lidar.figures.line()
        if self._testing:
            self.context.log.info(line)
        else:
            self.context.log.debug(line)

    def _open_preview(self) -> None:
        problem = display_problem()
        if problem:
            self.context.warn(problem)
            return
        title = self.context.spec.full_name
        self._preview = Preview(title, lambda: self.lidar.figures.line(), self.context.log.warning)
        self._preview.open()

    def _save_picture(self) -> Row:
        scan, beams = self._last_scan, self.lidar.beams
        if scan is None or beams is None:
            return ("last scan", False, "none received")
        self.context.log.info("the last scan\n%s", terminal_view(scan, beams))
        name = re.sub(r"[^A-Za-z0-9_]+", "_", self.context.spec.full_name).strip("_")
        from PIL import Image

        path = log_directory(os.environ) / f"{name}-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.png"
        try:
            make_private(path.parent)
            create_private(path)
            Image.fromarray(top_view(scan, beams)).save(path)
        except OSError as error:
            return ("last scan", False, f"cannot be written to {path}: {(error.strerror or '').lower()}")
        return ("last scan", True, str(path))


def judge(figures: Figures, model: Model, beams_per_turn: int) -> list[Row]:
    """Return the rows of MODE_TEST for the statistics of a scanner."""
    turns = abs(figures.turn_hz - model.turn_hz) <= TURN_TOLERANCE * model.turn_hz
    hint = "" if turns else f": free its rotor and check its power ({model.power})"
    points = figures.points >= LEAST_POINTS * beams_per_turn
    covered = figures.coverage >= LEAST_COVERAGE
    where = "" if covered else ": check whether its window is covered or everything is out of range"
    whole = figures.packets > 0 and figures.damaged <= DAMAGED_SHARE * figures.packets
    line = "" if whole else ": check cable and ground, and keep the cable away from motors"
    return [
        ("turns", turns, f"{figures.turn_hz:.3g} a second, usually {model.turn_hz:g}{hint}"),
        ("points of a turn", points, f"{figures.points} for {beams_per_turn} beams"),
        ("beams measured", covered, f"{figures.coverage:.0%}{where}"),
        ("packets whole", whole, f"{figures.packets} received, {figures.damaged} damaged sections{line}"),
    ]
