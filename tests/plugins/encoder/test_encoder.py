"""Encoders as a sensor, on emulated ones whose shaft's angle is known at every time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from joshua.devices.sensor import Reading
from joshua.devices.serial_errors import PortDisconnected
from joshua_emulator import EmulatedEncoder
from joshua_encoder.encoder import JOINT_STATE, SerialEncoder

Start = Callable[..., EmulatedEncoder]
Make = Callable[..., SerialEncoder]

KINDS: list[tuple[str, dict[str, Any], dict[str, Any], int]] = [
    ("line", {}, {}, 115_200),
    ("line", {"crc": True}, {}, 115_200),
    ("line", {"no_times": True}, {}, 115_200),
    ("line", {"counter_range": 5000}, {"counter_range": 5000}, 115_200),
    ("as5600", {}, {}, 115_200),
    ("amt21", {"resolution": 16384}, {"resolution": 16384}, 2_000_000),
    ("amt21", {"resolution": 4096}, {}, 2_000_000),
]


def readings(encoder: SerialEncoder, duration_s: float) -> list[Reading]:
    found = []
    end_s = time.monotonic() + duration_s
    while time.monotonic() < end_s:
        reading = encoder.read(0.2)
        if reading is not None:
            found.append(reading)
    return found


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
    offset_ns = time.time_ns() - time.monotonic_ns()
    found = readings(encoder, 3.0)
    assert len(found) > 200
    assert [reading.sequence for reading in found] == list(range(len(found)))
    positions = np.array([reading.data.position_rad[0] for reading in found])
    picked = found[:: len(found) // 20]
    truth = np.array([emulator.angle_rad(reading.stamp_ns - offset_ns) for reading in picked])
    shown = np.array([reading.data.position_rad[0] for reading in picked])
    turns = np.round((shown - truth) / math.tau)
    assert len(set(turns.tolist())) == 1  # an encoder knows its angle, not how often it has turned
    error = shown - truth - turns * math.tau
    # a line that comes late on a busy machine shows where the shaft was
    assert np.abs(error - np.median(error)).max() < 0.3
    if "counter_range" not in options:
        assert np.median(np.abs(error)) < 0.05
    assert np.ptp(positions) > 3.0
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
    first = readings(encoder, 0.3)[-1]
    emulator.ask("clear_faults")
    readings(encoder, 1.0)
    emulator.fault("stall")
    last = readings(encoder, 0.5)[-1]
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
    reading = readings(encoder, 0.2)[-1]
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
    emulator.fault("dirty", 2000)
    found = readings(encoder, 1.0)
    steps = np.abs(np.diff([reading.data.ticks[0] for reading in found]))
    assert len(found) > 100
    assert steps.max() < 100


def test_damaged_answers_are_asked_for_again(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("amt21", baudrate=2_000_000, resolution=16384)
    encoder = encoder_at(emulator.port, "amt21", 2_000_000, resolution=16384)
    encoder.connect()
    emulator.fault("drop", 0.1)
    assert len(readings(encoder, 1.5)) > 20
    assert encoder.damaged == 0
    emulator.fault("corrupt", 0.1)
    assert len(readings(encoder, 1.5)) > 20
    assert encoder.damaged > 2


def test_the_state_for_diagnostics(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("line", crc=True)
    encoder = encoder_at(emulator.port, joint_name=["left_wheel"])
    assert encoder.diagnostics() == ()
    encoder.connect()
    readings(encoder, 0.3)
    link, joint = encoder.diagnostics()
    assert (link.level, link.name, link.message) == (0, "link", "in order")
    assert joint.name == "left_wheel"
    assert float(joint.values["position_rad"]) != 0.0
    emulator.fault("corrupt", 0.05)
    readings(encoder, 0.5)
    link = encoder.diagnostics()[0]
    assert link.level == 1
    assert link.message == "the line damages what comes: check cable and ground"


@pytest.mark.parametrize(("kind", "baudrate"), [("as5600", 115_200), ("amt21", 2_000_000)])
def test_turns_are_kept_over_a_lost_connection(
    emulator_of: Start, encoder_at: Make, kind: str, baudrate: int
) -> None:
    emulator = emulator_of(kind, baudrate=baudrate)
    encoder = encoder_at(emulator.by_id, kind, baudrate)
    encoder.connect()
    end_s = time.monotonic() + 20
    while abs(encoder.read(0.2).data.ticks[0]) < 1.1 * 4096:  # more than a turn away from its first angle
        assert time.monotonic() < end_s
    emulator.fault("stall")
    time.sleep(0.2)
    last = readings(encoder, 0.3)[-1].data.position_rad[0]
    emulator.fault("unplug")
    with pytest.raises(PortDisconnected):
        readings(encoder, 5)
    encoder.disconnect()
    emulator.fault("replug")
    encoder.connect()
    first = next(reading for reading in iter(lambda: encoder.read(0.2), object()) if reading is not None)
    assert first.data.position_rad[0] == pytest.approx(last, abs=0.01)
    assert first.data.velocity_rad_s[0] == 0.0
