"""From measurements to scans: beams, gaps, limits and times."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from joshua_lidar.assembly import Beams, Scan, TurnAssembler
from joshua_lidar.samples import Samples

TURN_NS = 100_000_000
PER_TURN = 360
PER_PACKET = 10
START_NS = 1_700_000_000_000_000_000


def turning(turns: float, first_cw_deg: float = 77.0) -> tuple[Samples, np.ndarray]:
    """A scanner that turns clockwise and sees, in each direction, the angle in radians plus 1, in metres."""
    number = np.arange(round(turns * PER_TURN))
    clockwise = np.radians(first_cw_deg + number * 360 / PER_TURN)
    packet_end = (number // PER_PACKET + 1) * PER_PACKET
    times = START_NS + (packet_end - 1) * TURN_NS // PER_TURN
    ccw = np.mod(-clockwise, math.tau)
    return Samples(-clockwise, ccw + 1, np.full(len(number), 5.0), packet_end), times


def assemble(assembler: TurnAssembler, turns: float, piece: int = 37) -> list[Scan]:
    samples, times = turning(turns)
    scans = []
    for start in range(0, len(samples), piece):
        cut = slice(start, start + piece)
        part = Samples(samples.angle_rad[cut], samples.range_m[cut], samples.intensity[cut], samples.end[cut])
        scans += assembler.add(part, times[cut])
    return scans


def whole_turn(count: int = 360) -> Beams:
    return Beams.of(-math.pi, math.pi - 1e-4, count)


@pytest.mark.parametrize(
    ("low", "high", "count"),
    [
        (-math.pi, math.pi, 360),
        (-3.1415, 3.1415, 360),
        (0.0, math.tau, 360),
        (0.0, math.pi / 2, 91),
        (1.0, 1.01, 1),
    ],
)
def test_beams_fill_the_window_and_never_more_than_a_turn(low: float, high: float, count: int) -> None:
    beams = Beams.of(low, high, 360)
    assert beams.count == count
    assert beams.angle_min_rad == low
    assert beams.angle_max_rad <= high + 1e-6
    assert beams.angle_max_rad == pytest.approx(low + (count - 1) * beams.increment_rad)


def test_one_scan_a_turn_each_beam_in_its_direction() -> None:
    beams = whole_turn()
    scans = assemble(TurnAssembler(beams, 0.0, 100.0), 5)
    assert len(scans) == 4 - 1 + (1 if len(scans) == 4 else 0)  # the first one is not whole
    angle = beams.angle_min_rad + beams.increment_rad * np.arange(beams.count)
    for scan in scans:
        expected = np.mod(angle, math.tau) + 1
        off = np.abs(scan.ranges_m - expected)
        assert np.all(np.minimum(off, math.tau - off) < 0.01)
        assert scan.points == PER_TURN
        assert set(scan.intensities) == {5.0}


def test_each_beam_has_the_time_of_its_measurement() -> None:
    beams = whole_turn()
    scans = assemble(TurnAssembler(beams, 0.0, 100.0), 5)
    samples, _ = turning(5)
    taken_ns = START_NS + np.arange(len(samples)) * TURN_NS // PER_TURN
    for scan in scans:
        assert scan.turn_s == pytest.approx(0.1, rel=1e-3)
        for beam in (0, 100, 359):
            at_ns = scan.stamp_ns + round(beam * scan.time_increment_s * 1e9)
            angle = beams.angle_min_rad + beam * beams.increment_rad
            behind = np.abs((samples.angle_rad - angle + math.pi) % math.tau - math.pi) < beams.increment_rad
            assert np.abs(taken_ns[behind] - at_ns).min() < TURN_NS / 100
    assert np.diff([scan.stamp_ns for scan in scans]) == pytest.approx(TURN_NS, rel=1e-3)


def test_limits_by_rep_117_and_gaps() -> None:
    samples, times = turning(3)
    range_m = samples.range_m.copy()
    range_m[np.mod(-samples.angle_rad, math.tau) < 0.5] = np.nan  # nothing measured there
    beams = whole_turn()
    assembler = TurnAssembler(beams, 2.0, 6.0)
    (scan,) = assembler.add(Samples(samples.angle_rad, range_m, samples.intensity, samples.end), times)[:1]
    direction = np.mod(beams.angle_min_rad + beams.increment_rad * np.arange(beams.count), math.tau)
    assert np.all(np.isneginf(scan.ranges_m[(direction > 0.02) & (direction < 0.9)]))
    assert np.all(np.isnan(scan.ranges_m[direction > math.tau - 0.45]))
    assert np.all(np.isposinf(scan.ranges_m[(direction > 5.1) & (direction < math.tau - 0.55)]))
    assert np.all(np.isfinite(scan.ranges_m[(direction > 1.1) & (direction < 4.9)]))


def test_a_lost_packet_leaves_beams_without_a_measurement() -> None:
    samples, times = turning(3)
    keep = np.ones(len(samples), bool)
    keep[500:520] = False
    part = Samples(samples.angle_rad[keep], samples.range_m[keep], samples.intensity[keep], samples.end[keep])
    scans = TurnAssembler(whole_turn(), 0.0, 100.0).add(part, times[keep])
    assert sum(int(np.isnan(scan.ranges_m).sum()) for scan in scans) == pytest.approx(20, abs=3)


def test_after_a_long_silence_the_turn_under_way_is_forgotten() -> None:
    samples, times = turning(6)
    times = times.copy()
    times[800:] += 3 * TURN_NS
    scans = TurnAssembler(whole_turn(), 0.0, 100.0)
    found = scans.add(
        Samples(samples.angle_rad[:800], samples.range_m[:800], samples.intensity[:800], samples.end[:800]),
        times[:800],
    )
    found += scans.add(
        Samples(samples.angle_rad[800:], samples.range_m[800:], samples.intensity[800:], samples.end[800:]),
        times[800:],
    )
    assert all(scan.turn_s == pytest.approx(0.1, rel=0.01) for scan in found)


def test_a_scanner_that_stands_still_makes_no_scan() -> None:
    count = 2000
    samples = Samples(np.full(count, 1.0), np.ones(count), np.ones(count), np.arange(count) * 5)
    assembler = TurnAssembler(whole_turn(), 0.0, 100.0)
    assert assembler.add(samples, START_NS + np.arange(count) * 1_000_000) == []


def test_a_stamp_a_little_beyond_now_is_now_and_one_far_beyond_is_no_stamp() -> None:
    scan = Scan(1_000_000_000, -1e-3, 0.1, np.zeros(3, np.float32), np.zeros(0, np.float32), 3)
    assert scan.not_later_than(1_000_000_000) is scan
    late = scan.not_later_than(998_000_000)
    assert late is not None
    assert (late.stamp_ns, late.turn_s, late.points) == (998_000_000, 0.1, 3)
    assert scan.not_later_than(949_000_000) is None


@pytest.mark.parametrize("first_cw_deg", np.arange(0.0, 9.6, 0.8))
@pytest.mark.parametrize("lost", [(), (0,), (37,), (38,), (37, 38), (38, 0)], ids=str)
def test_every_turn_is_published_wherever_the_packets_of_an_ld19_lie(
    first_cw_deg: float, lost: tuple[int, ...]
) -> None:
    """37.5 packets a turn: each second turn ends with a packet; near the seam some of each turn are lost."""
    step_deg, packet_ns, jitter = 0.8, 12 * TURN_NS // 450, random.Random(1)
    assembler = TurnAssembler(whole_turn(450), 0.0, 100.0)
    stamps: list[int] = []
    for number in range(38 * 12):
        first = first_cw_deg + 12 * step_deg * number
        clockwise = np.radians((first + step_deg * np.arange(12)) % 360)
        now_ns = START_NS + (number + 1) * packet_ns + round(jitter.uniform(0, 2e6))
        packets_after_the_seam = round((first - 180) % 360 / 9.6)
        if packets_after_the_seam in lost and number % 75 < 40:  # in each second turn
            continue
        samples = Samples(-clockwise, np.ones(12), np.ones(12), np.full(12, 47 * (number + 1)))
        for turn in assembler.add(samples, np.full(12, now_ns)):
            scan = turn.not_later_than(now_ns)
            assert scan is not None
            stamps.append(scan.stamp_ns)
    turns = np.diff(stamps) / TURN_NS
    assert len(stamps) >= 10
    assert turns == pytest.approx(np.ones(len(turns)), abs=0.1)
