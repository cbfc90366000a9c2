"""Encoders as a sensor, on emulated ones whose shaft's angle is known at every time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from eventually import eventually
from joshua.devices.sensor import Reading
from joshua_emulator import EmulatedEncoder
from joshua_encoder.encoder import JOINT_STATE, SerialEncoder
from joshua_serial.errors import PortDisconnected

Start = Callable[..., EmulatedEncoder]
Make = Callable[..., SerialEncoder]

#: Fastest that the emulated shaft turns.
SHAFT_RAD_S = 9.0 * math.tau / 12.0

KINDS: list[tuple[str, dict[str, Any], dict[str, Any], int]] = [
    ("line", {}, {}, 115_200),
    ("line", {"crc": True}, {}, 115_200),
    ("line", {"no_times": True}, {}, 115_200),
    ("line", {"counter_range": 5000}, {"counter_range": 5000}, 115_200),
    ("as5600", {}, {}, 115_200),
    ("amt21", {"resolution": 16384}, {"resolution": 16384}, 2_000_000),
    ("amt21", {"resolution": 4096}, {}, 2_000_000),
]


class Readings:
    """Readings with the times at which they came.

    What comes late, because this process or the emulator was held up, comes after a gap.
    """

    def __init__(self) -> None:
        self.found: list[Reading] = []
        self._came_s = [time.monotonic()]

    def take(self, encoder: SerialEncoder, count: int, duration_s: float = 0.0) -> Readings:
        """Reads on, until there are ``count`` more and ``duration_s`` has passed."""
        wanted, begun_s = len(self.found) + count, time.monotonic()
        while len(self.found) < wanted or time.monotonic() < begun_s + duration_s:
            assert time.monotonic() < begun_s + duration_s + 60, f"{len(self.found)} of {wanted} came"
            reading = encoder.read(0.2)
            if reading is not None:
                self.found.append(reading)
                self._came_s.append(time.monotonic())
        return self

    def lateness_s(self, index: int) -> float:
        """How late a reading may be: the longest gap in the time before it."""
        came_s = np.array(self._came_s[: index + 2])
        return float(np.diff(came_s)[came_s[1:] >= came_s[-1] - 2.0].max())


def readings(encoder: SerialEncoder, count: int, duration_s: float = 0.0) -> list[Reading]:
    return Readings().take(encoder, count, duration_s).found


def at_rest(encoder: SerialEncoder) -> Reading:
    """A reading of a shaft that is held fast; those that were under way before come first."""
    found = readings(encoder, 1)
    end_s = time.monotonic() + 60
    while len(found) < 20 or len({reading.data.ticks for reading in found[-20:]}) > 1:
        assert time.monotonic() < end_s, "the shaft does not stand still"
        found += readings(encoder, 1)
    return found[-1]


@pytest.mark.timing
@pytest.mark.parametrize(("kind", "options", "fields", "baudrate"), KINDS)
def test_positions_follow_the_shaft_over_its_turns(
    emulator_of: Start,
    encoder_at: Make,
    kind: str,
    options: dict[str, Any],
    fields: dict[str, Any],
    baudrate: int,
) -> None:
    emulator = emulator_of(kind, baudrate=baudrate, **options)
    encoder = encoder_at(emulator.port, kind, baudrate, **fields)
    encoder.connect()
    taken = Readings()
    offset_ns = time.time_ns() - time.monotonic_ns()
    sent = emulator.ask("state")["sent"]
    taken.take(encoder, 200, 3.0)
    eventually(
        lambda: np.ptp([reading.data.position_rad[0] for reading in taken.take(encoder, 10).found]) > 3.0
    )
    found, sent = taken.found, emulator.ask("state")["sent"] - sent
    assert len(found) > 0.3 * sent  # some answers are asked for twice, and some lines may still be waiting
    assert [reading.sequence for reading in found] == list(range(len(found)))
    # the first ones may have waited while the encoder was opened
    places = range(len(found) // 10, len(found), len(found) // 20)
    picked = [found[place] for place in places]
    truth = np.array([emulator.angle_rad(reading.stamp_ns - offset_ns) for reading in picked])
    shown = np.array([reading.data.position_rad[0] for reading in picked])
    late_s = np.array([taken.lateness_s(place) for place in places])
    turns = np.round((shown - truth) / math.tau)
    # an encoder knows its angle, not how often it has turned; nor how far it went while nobody could see it
    followed = late_s < 0.5 * math.pi / SHAFT_RAD_S
    if followed.all():
        assert len(set(turns.tolist())) == 1
    error = shown - truth - turns * math.tau
    # what comes late shows where the shaft was; where the others show it, a counter that began anew is off
    prompt = late_s <= max(0.05, float(np.median(late_s)))
    error -= np.median(error[prompt]) if "counter_range" in options else 0.0
    assert np.all(np.abs(error) < 0.1 + SHAFT_RAD_S * late_s)
    assert np.median(np.abs(error[prompt])) < 0.05 + SHAFT_RAD_S * np.median(late_s[prompt])
    wrong = []
    for reading in picked[3:]:
        at_ns = reading.stamp_ns - offset_ns
        slope = (emulator.angle_rad(at_ns + 10**7) - emulator.angle_rad(at_ns - 10**7)) / 0.02
        wrong.append(abs(reading.data.velocity_rad_s[0] - slope))
    assert np.median(wrong) < 0.5


def test_several_encoders_on_one_bus(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("amt21", baudrate=2_000_000, resolution=16384, addresses=[84, 88, 92])
    encoder = encoder_at(
        emulator.port,
        "amt21",
        2_000_000,
        resolution=16384,
        address=[84, 88, 92],
        joint_name=["hip", "knee", "ankle"],
        inverted=True,
    )
    emulator.fault("stall")
    encoder.connect()
    first = at_rest(encoder)
    emulator.fault("turn", 0.4)  # less than half a turn of it: nobody need see it on its way
    eventually(lambda: abs(at_rest(encoder).data.position_rad[0] - first.data.position_rad[0]) > 0.1)
    last = at_rest(encoder)
    message = encoder.message(last, JOINT_STATE, "base")
    assert list(message.name) == ["hip", "knee", "ankle"]
    moved = np.subtract(last.data.position_rad, first.data.position_rad)
    assert abs(moved[0]) > 0.1
    assert moved[1] == pytest.approx(moved[0] / 2, abs=0.002)
    assert moved[2] == pytest.approx(moved[0] / 4, abs=0.002)
    assert first.data.position_rad[0] <= 0.0  # inverted


def test_the_message_is_a_joint(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("line")
    encoder = encoder_at(emulator.port, joint_name=["left_wheel"])
    encoder.connect()
    reading = readings(encoder, 10)[-1]
    message = encoder.message(reading, JOINT_STATE, "base_link")
    assert list(message.name) == ["left_wheel"]
    assert message.position[0] == reading.data.position_rad[0]
    assert message.velocity[0] == reading.data.velocity_rad_s[0]
    assert message.header.frame_id == "base_link"
    assert reading.data.position_rad[0] == pytest.approx(reading.data.ticks[0] * math.tau / 4096)


def test_noise_and_half_a_line_at_the_start(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("line", crc=True, fault=["dirty=500"])
    encoder = encoder_at(emulator.port)
    encoder.connect()
    taken = Readings()
    emulator.fault("dirty", 2000)
    taken.take(encoder, 150)
    steps = np.abs(np.diff([reading.data.ticks[0] for reading in taken.found]))
    gaps_s = np.array([taken.lateness_s(index) for index in range(1, len(taken.found))])
    assert np.all(steps < 100 + SHAFT_RAD_S / math.tau * 4096 * gaps_s)


def test_damaged_answers_are_asked_for_again(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("amt21", baudrate=2_000_000, resolution=16384)
    encoder = encoder_at(emulator.port, "amt21", 2_000_000, resolution=16384)
    encoder.connect()
    emulator.fault("drop", 0.1)
    readings(encoder, 40)
    assert emulator.ask("state")["fault_counts"]["drop"] > 0
    assert encoder.damaged == 0
    emulator.fault("corrupt", 0.1)
    readings(encoder, 40)
    eventually(lambda: readings(encoder, 1) and encoder.damaged > 2, "damaged answers")


def test_the_state_for_diagnostics(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("line", crc=True)
    encoder = encoder_at(emulator.port, joint_name=["left_wheel"])
    assert encoder.diagnostics() == ()
    encoder.connect()
    readings(encoder, 40)
    link, joint = encoder.diagnostics()
    assert (link.level, link.name, link.message) == (0, "link", "in order")
    assert joint.name == "left_wheel"
    assert float(joint.values["position_rad"]) != 0.0
    emulator.fault("corrupt", 0.05)
    eventually(lambda: readings(encoder, 1) and encoder.diagnostics()[0].level == 1, "the warning")
    link = encoder.diagnostics()[0]
    assert link.message == "the line damages data: check cable and ground"


@pytest.mark.parametrize(("kind", "baudrate"), [("as5600", 115_200), ("amt21", 2_000_000)])
def test_turns_are_kept_over_a_lost_connection(
    emulator_of: Start, encoder_at: Make, kind: str, baudrate: int
) -> None:
    emulator = emulator_of(kind, baudrate=baudrate)
    encoder = encoder_at(emulator.by_id, kind, baudrate)
    encoder.connect()
    end_s = time.monotonic() + 60
    while abs(readings(encoder, 1)[0].data.ticks[0]) < 1.1 * 4096:  # more than a turn from its first angle
        assert time.monotonic() < end_s
    emulator.fault("stall")
    last = at_rest(encoder).data.position_rad[0]
    emulator.fault("unplug")
    with pytest.raises(PortDisconnected):
        readings(encoder, 100_000)
    encoder.disconnect()
    emulator.fault("replug")
    encoder.connect()
    (first,) = readings(encoder, 1)
    assert first.data.position_rad[0] == pytest.approx(last, abs=0.01)
    assert first.data.velocity_rad_s[0] == 0.0
