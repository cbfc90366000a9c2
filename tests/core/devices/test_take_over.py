from __future__ import annotations

import logging

import pytest
from joshua.devices.command_intake import TakeOver, Turn

LOG = logging.getLogger("test_take_over")
MS = 1_000_000


def take_over() -> TakeOver:
    return TakeOver(["/gamepad", "/pedal"], LOG)


def test_without_an_override_everybody_commands() -> None:
    one = take_over()
    assert one.turn("/model", 1) is Turn.OURS
    assert one.turn("", 2) is Turn.OURS


def test_others_wait_until_it_has_been_silent() -> None:
    one = take_over()
    assert one.turn("/gamepad", 1000 * MS) is Turn.FIRST
    assert one.turn("/gamepad", 1100 * MS) is Turn.OURS
    assert one.turn("/model", 1101 * MS) is Turn.NOT_OURS
    assert one.turn("", 1599 * MS) is Turn.NOT_OURS
    assert one.turn("/model", 1600 * MS) is Turn.FIRST
    assert one.turn("/model", 1601 * MS) is Turn.OURS
    assert one.turn("/gamepad", 1602 * MS) is Turn.FIRST


def test_a_trajectory_of_the_override_is_not_interrupted() -> None:
    one = take_over()
    one.turn("/gamepad", 0, lasts_s=2.0)
    assert one.turn("/model", 2499 * MS) is Turn.NOT_OURS
    assert one.turn("/model", 2500 * MS) is Turn.FIRST


def test_each_change_of_hands_is_reported_once(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    one = take_over()
    for now in range(3):
        one.turn("/gamepad", now)
    one.turn("/pedal", 4)
    one.turn("/model", 900 * MS)
    assert caplog.messages == [
        "/gamepad takes over: commands of others are ignored while it sends",
        "/pedal takes over: commands of others are ignored while it sends",
        "/pedal has been silent for 0.5 s: other commands count again",
    ]
