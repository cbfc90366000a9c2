"""Clients that others wrote find a scanner in the emulator: rplidar-roboticia, pyrplidar and lds2d."""

from __future__ import annotations

import contextlib
import io
import itertools
import time
import warnings
from collections.abc import Callable
from typing import TypeVar

import numpy as np
import pytest
from joshua_emulator import EmulatedLidar
from joshua_emulator.lidar.room import distances_m

ATTEMPTS = 5
PATIENT_S = 30

T = TypeVar("T")


def undisturbed(emulator: EmulatedLidar, read: Callable[[], T]) -> T:
    """A reading during which no byte was lost: a line loses some while a busy machine holds its reader up."""
    for _ in range(ATTEMPTS):
        lost = len(emulator.log("overrun"))
        try:
            return read()
        except Exception:
            if len(emulator.log("overrun")) == lost:
                raise
    raise AssertionError(f"the line lost bytes in each of {ATTEMPTS} attempts")


def wait_until(reached: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 60
    while not reached():
        assert time.monotonic() < deadline_s
        time.sleep(0.01)


def disagreement_m(degrees: list[float], mm: list[float]) -> float:
    """Median distance between what a client measured and the room."""
    truth = distances_m(-np.radians(degrees))
    return float(np.median(np.abs(np.array(mm) / 1000 - truth)))


@pytest.mark.parametrize("scan_type", ["normal", "express"])
def test_rplidar_roboticia_drives_the_a1(scan_type: str, monkeypatch: pytest.MonkeyPatch) -> None:
    rplidar = pytest.importorskip("rplidar")
    # a pseudo-terminal has no modem lines, and this client insists on DTR
    monkeypatch.setattr(rplidar.serial.Serial, "_update_dtr_state", lambda _: None)
    with EmulatedLidar("rplidar_a1") as emulator:

        def drive() -> None:
            client = rplidar.RPLidar(emulator.port, timeout=PATIENT_S)
            try:
                info = client.get_info()
                assert info["model"] == 0x18
                assert info["firmware"] == (1, 29)
                assert client.get_health() == ("Good", 0)
                measures = list(itertools.islice(client.iter_measures(scan_type), 900))
                starts = sum(new for new, _, _, _ in measures)
                assert 1 <= starts <= 3
                degrees, mm = [m[2] for m in measures], [m[3] for m in measures]
                assert disagreement_m(degrees, mm) < 0.01
                assert emulator.state()["motor"]
            finally:
                client.stop()
                client.stop_motor()
                wait_until(lambda: not emulator.state()["motor"])
                client.disconnect()

        undisturbed(emulator, drive)


def test_pyrplidar_drives_the_c1() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pyrplidar = pytest.importorskip("pyrplidar")
    with EmulatedLidar("rplidar_c1") as emulator, contextlib.redirect_stdout(io.StringIO()):

        def drive() -> None:
            client = pyrplidar.PyRPlidar()
            client.connect(emulator.port, 460_800, timeout=PATIENT_S)
            try:
                assert client.get_info().model == 0x41
                assert client.get_health().status == 0
                assert client.get_scan_mode_typical() == 1
                assert [mode.name for mode in client.get_scan_modes()] == ["Standard", "Express"]
                measures = list(itertools.islice(client.start_scan()(), 1200))
                assert disagreement_m([m.angle for m in measures], [m.distance for m in measures]) < 0.01
                assert sum(m.start_flag for m in measures) >= 2
            finally:
                client.stop()
                client.disconnect()

        undisturbed(emulator, drive)


@pytest.mark.parametrize(
    ("model", "name"),
    [
        ("rplidar_a1", "RPLIDAR-A1"),
        ("rplidar_c1", "RPLIDAR-C1"),
        ("ld06", "LDROBOT-LD06"),
        ("ld19", "LDROBOT-LD19"),
        ("ydlidar_x2", "YDLIDAR-X2"),
        ("ydlidar_x4", "YDLIDAR-X4"),
    ],
)
def test_lds2d_reads_the_same_room(model: str, name: str) -> None:
    lds2d = pytest.importorskip("lds2d")
    with EmulatedLidar(model) as emulator:

        def drive() -> None:
            with lds2d.Lidar.open(name, port=emulator.port, baud=emulator.state()["baudrate"]) as client:
                client.start()
                points = [point for point in itertools.islice(client.points(), 1500) if point.valid]
                client.stop()
            assert len(points) > 1400
            assert disagreement_m([p.angle_deg for p in points], [p.dist_mm for p in points]) < 0.02

        undisturbed(emulator, drive)
