"""The time of a bus cycle, held against figures that were calculated by hand and measured by others."""

from __future__ import annotations

import pytest
from joshua.config.checks.rates import BusCycle, bus_cycle, rate_text
from joshua.schema.config_pb2 import DynamixelConfig, STS3215Config
from joshua.schema.rules import block_rule

STS3215, DYNAMIXEL = (block_rule(message.DESCRIPTOR).bus for message in (STS3215Config, DynamixelConfig))


@pytest.mark.parametrize(("data", "expected_ms"), [(2, 0.62), (8, 0.98), (15, 1.40)])
def test_sync_read_of_six_servos_at_one_megabit(data: int, expected_ms: float) -> None:
    cycle = BusCycle(servos=6, baudrate=1_000_000, request=8 + 6, replies=6 * (6 + data), command=0)
    assert cycle.duration_s * 1000 == pytest.approx(expected_ms, abs=1e-9)


def test_a_leader_only_reads() -> None:
    cycle = bus_cycle(STS3215, 6, 1_000_000, commanded=False)
    assert (cycle.request, cycle.replies, cycle.command, cycle.total_bytes) == (14, 72, 0, 86)


def test_a_follower_reads_and_writes() -> None:
    cycle = bus_cycle(STS3215, 6, 1_000_000, commanded=True)
    assert cycle.command == 26  # 0.26 ms: sync write of two bytes to six servos
    assert cycle.duration_s == pytest.approx(0.00112)
    assert cycle.max_rate_hz == pytest.approx(892.857, abs=0.001)
    assert cycle.practical_rate_hz == pytest.approx(1 / 0.00212)


def test_the_packets_of_protocol_2_are_longer() -> None:
    """The sum holds for packets that are put together byte by byte."""
    sync_read = bytes.fromhex("FFFFFD00 FE 0D00 82 8400 0400") + bytes(6) + b"CC"
    reply = bytes.fromhex("FFFFFD00 01 0E00 55 00") + bytes(10) + b"CC"
    sync_write = bytes.fromhex("FFFFFD00 FE 2500 83 7400 0400") + 6 * bytes(5) + b"CC"
    cycle = bus_cycle(DYNAMIXEL, 6, 1_000_000, commanded=True)
    assert (cycle.request, cycle.replies, cycle.command) == (len(sync_read), 6 * len(reply), len(sync_write))
    assert cycle.duration_s == pytest.approx(0.0019)


def test_the_calculation_is_shown() -> None:
    text = bus_cycle(STS3215, 6, 115_200, commanded=True).calculation()
    assert text == (
        "6 servos: sync read 14 + replies 72 + sync write 26 = 112 bytes = 1120 bits; "
        "at 115200 bit/s 9.72 ms a cycle, at most 102 Hz"
    )
    assert (
        bus_cycle(STS3215, 1, 115_200, commanded=False)
        .calculation()
        .startswith("1 servo: sync read 9 + replies 12 =")
    )


@pytest.mark.parametrize(
    ("rate", "text"),
    [(1162.79, "1160"), (892.857, "892"), (102.86, "102"), (99.99, "99.9"), (4.56, "4.5"), (0.57, "0.5")],
)
def test_shown_rates_are_rounded_down(rate: float, text: str) -> None:
    assert rate_text(rate) == text
    assert float(text) <= rate
