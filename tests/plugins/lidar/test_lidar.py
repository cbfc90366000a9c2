"""The scanner as a sensor, on emulated scanners of every model in a room whose walls are known."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from eventually import eventually
from joshua.devices.sensor import Reading
from joshua_emulator import EmulatedLidar
from joshua_emulator.lidar.room import distances_m
from joshua_lidar.assembly import Scan
from joshua_lidar.lidar import LASER_SCAN, SerialLidar
from joshua_lidar.models import MODELS, same_stream

Start = Callable[..., EmulatedLidar]
Make = Callable[..., SerialLidar]


def next_reading(lidar: SerialLidar, timeout_s: float = 60.0) -> Reading:
    deadline_s = time.monotonic() + timeout_s
    while time.monotonic() < deadline_s:
        reading = lidar.read(0.2)
        if reading is not None:
            return reading
    raise AssertionError("no scan came")


def steady_reading(lidar: SerialLidar) -> Reading:
    """The next turn in which time ran evenly; before the rate of a line is known, a stall shows in it."""
    assert lidar.model is not None
    turn_s = 1 / lidar.model.turn_hz
    reading = eventually(lambda: _steady(next_reading(lidar), turn_s), "a turn as long as it should be")
    assert reading is not None
    return reading


def _steady(reading: Reading, turn_s: float) -> Reading | None:
    return reading if abs(reading.data.turn_s - turn_s) < 0.4 * turn_s else None


def beam_angles(lidar: SerialLidar) -> np.ndarray:
    assert lidar.beams is not None
    return lidar.beams.angle_min_rad + lidar.beams.increment_rad * np.arange(lidar.beams.count)


def agrees_with_the_room(lidar: SerialLidar, scan: Scan) -> float:
    """Share of the measured beams that show what stands in their direction."""
    ranges = scan.ranges_m
    measured = np.isfinite(ranges)
    angle = beam_angles(lidar)[measured]
    near = [np.abs(ranges[measured] - distances_m(angle + off)) for off in np.radians([-0.6, 0, 0.6])]
    return float(np.mean(np.min(near, axis=0) < 0.03))


@pytest.mark.parametrize("told", [True, False], ids=["model given", "model found out"])
@pytest.mark.parametrize("model", MODELS)
def test_each_model_sees_the_room(emulator_of: Start, lidar_at: Make, model: str, told: bool) -> None:
    emulator = emulator_of(model)
    lidar = lidar_at(emulator.port, model if told else "", MODELS[model].baudrate)
    lidar.connect()
    assert lidar.model is not None
    assert same_stream(lidar.model.name, model)
    scan: Scan = steady_reading(lidar).data
    assert scan.ranges_m.shape == (MODELS[model].beams,)
    assert np.mean(np.isfinite(scan.ranges_m)) > 0.98
    assert agrees_with_the_room(lidar, scan) > 0.97
    lidar.disconnect()
    if MODELS[model].family != "none":
        eventually(lambda: not emulator.state()["motor"], "the stop of the motor")


@pytest.mark.parametrize("model", ["rplidar_a1", "rplidar_c1"])
def test_the_standard_scan_of_an_rplidar(emulator_of: Start, lidar_at: Make, model: str) -> None:
    emulator = emulator_of(model)
    lidar = lidar_at(emulator.port, model, scan_mode="standard")
    lidar.connect()
    scan: Scan = next_reading(lidar).data
    assert scan.ranges_m.shape == (MODELS[model].standard_beams,)
    assert agrees_with_the_room(lidar, scan) > 0.97
    assert scan.intensities.shape == scan.ranges_m.shape
    assert set(scan.intensities) == {47.0}


def test_the_message_describes_its_beams(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("ld19")
    lidar = lidar_at(emulator.port, "ld19", range_min=1.0, range_max=3.0)
    before_ns = time.time_ns()
    lidar.connect()
    next_reading(lidar)
    reading = steady_reading(lidar)
    message = lidar.message(reading, LASER_SCAN, "laser")
    count = len(message.ranges)
    assert message.header.frame_id == "laser"
    assert count == len(message.intensities) == 450
    assert message.angle_increment == pytest.approx(math.tau / 450)
    assert message.angle_min == pytest.approx(-3.1415)
    assert message.angle_max == pytest.approx(message.angle_min + (count - 1) * message.angle_increment)
    assert message.scan_time == pytest.approx(0.1, rel=0.4)
    # the scanner turns clockwise: the first beam of the message is measured last
    assert message.time_increment == pytest.approx(-message.scan_time / 450, rel=0.05)
    assert before_ns < reading.stamp_ns < time.time_ns()
    ranges = np.asarray(message.ranges)
    truth = distances_m(beam_angles(lidar))
    assert np.all(np.isneginf(ranges[truth < 0.95]))
    assert np.all(np.isposinf(ranges[truth > 3.3]))
    measured = ranges[np.isfinite(ranges)]
    assert measured.min() >= 1.0
    assert measured.max() <= 3.0


def test_a_window_is_cut_out(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("ld19")
    lidar = lidar_at(emulator.port, "ld19", angle_min=-0.5, angle_max=1.0)
    lidar.connect()
    scan: Scan = next_reading(lidar).data
    assert lidar.beams is not None
    assert lidar.beams.count == math.floor(1.5 / (math.tau / 450)) + 1
    assert lidar.beams.angle_max_rad <= 1.0
    assert agrees_with_the_room(lidar, scan) > 0.9  # the sides of the corridor are seen at a flat angle


def test_scans_follow_each_other_at_the_pace_of_the_turns(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("ld19")
    lidar = lidar_at(emulator.port, "ld19")
    lidar.connect()
    readings = [next_reading(lidar) for _ in range(12)]
    assert [reading.sequence for reading in readings] == list(range(12))

    def at_pace() -> bool:
        """Whether the last turns were; before the rate of a line is known, a stall shows in their times."""
        readings.append(next_reading(lidar))
        distances_s = np.diff([reading.stamp_ns for reading in readings[-12:]]) / 1e9
        return abs(float(np.median(distances_s)) - 0.1) < 0.02

    eventually(at_pace, "the pace of the turns")


def test_a_scan_that_another_program_left_running(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("rplidar_a1")
    with open(emulator.port, "r+b", buffering=0) as line:
        first = lidar_at(emulator.port, "rplidar_a1")
        first.connect()
        next_reading(first)
        first._port.close()  # as a program that crashed: nobody stops the scanner
        assert emulator.state()["scanning"]
        assert line
    second = lidar_at(emulator.port)
    second.connect()
    assert agrees_with_the_room(second, next_reading(second).data) > 0.97


def test_noise_and_half_a_packet_at_the_start(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("ld19", fault=["dirty=700"])
    lidar = lidar_at(emulator.port, "ld19")
    lidar.connect()
    emulator.fault("dirty", 3000)
    for _ in range(5):
        assert agrees_with_the_room(lidar, next_reading(lidar).data) > 0.97


def test_a_line_that_loses_packets_leaves_gaps(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("rplidar_a1")
    lidar = lidar_at(emulator.port, scan_mode="standard")
    lidar.connect()
    emulator.fault("drop", 0.1)

    def next_gaps() -> Scan | None:
        """The next scan with gaps; those before were measured before the fault."""
        scan: Scan = next_reading(lidar).data
        return scan if np.isnan(scan.ranges_m).mean() > 0.01 else None

    eventually(next_gaps, "a scan with gaps")  # one that began before the fault
    scan = eventually(next_gaps, "another one")
    assert scan is not None
    assert np.isnan(scan.ranges_m).mean() < 0.4
    assert agrees_with_the_room(lidar, scan) > 0.95


def test_the_state_for_diagnostics(emulator_of: Start, lidar_at: Make) -> None:
    emulator = emulator_of("rplidar_c1")
    lidar = lidar_at(emulator.port, "rplidar_c1")
    assert lidar.diagnostics() == ()
    lidar.connect()
    steady_reading(lidar)
    eventually(lambda: next_reading(lidar) and abs(lidar.figures.turn_hz - 10) < 2, "the usual turns")
    (row,) = lidar.diagnostics()
    assert (row.level, row.name, row.message) == (0, "scanner", "in order")
    assert row.hardware_id.startswith("RPLIDAR C1, firmware 1.29, serial number ")
    assert float(row.values["turn_hz"]) == pytest.approx(10, rel=0.2)
    assert row.values["damaged"] == "0"


def held_up_readings(lidar: SerialLidar, held_up_s: float) -> list[Reading]:
    """Turns of a reader that is held up; none where the machine or the emulator was held up, too."""
    while lidar._ready:  # from before
        next_reading(lidar)
    readings, begun_s, damaged = [steady_reading(lidar)], time.monotonic(), lidar.figures.damaged
    time.sleep(held_up_s)
    readings += [next_reading(lidar) for _ in range(2 + round(held_up_s * 10))]
    even = all(_steady(reading, 0.1) for reading in readings)
    if not even or time.monotonic() - begun_s > held_up_s + 0.5:
        return []
    assert lidar.figures.damaged == damaged
    return readings


@pytest.mark.timing
def test_a_reader_that_is_held_up_again_and_again_loses_no_turn(emulator_of: Start, lidar_at: Make) -> None:
    """On a busy machine more than half a turn may wait for the reader each time, and now and then many."""
    lidar = lidar_at(emulator_of("rplidar_c1").port, "rplidar_c1", MODELS["rplidar_c1"].baudrate)
    lidar.connect()
    end_s = time.monotonic() + 0.7  # from then on the rate of the line is known
    while time.monotonic() < end_s:
        next_reading(lidar)
    readings: list[Reading] = []
    for held_up_s in (0.12, 0.05, 0.13, 0.9, 0.12, 0.04, 0.12):
        found = eventually(partial(held_up_readings, lidar, held_up_s), "an even time")
        # every turn is there, at its time
        assert abs((found[-1].stamp_ns - found[0].stamp_ns) / 1e8 - (len(found) - 1)) < 0.8
        readings += found
    assert np.mean([agrees_with_the_room(lidar, reading.data) for reading in readings]) > 0.95
