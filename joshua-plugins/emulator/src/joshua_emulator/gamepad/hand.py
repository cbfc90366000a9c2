"""Motion of an emulated gamepad in place of the user."""

from __future__ import annotations

import math

#: Idle time at the start of each round.
REST_S = 1.0

#: Length of the rest of a round.
ROUND_S = 12.0

_STICKS = ("left_x", "left_y", "right_x", "right_y")


def demonstration(elapsed_s: float) -> dict[str, float]:
    """A hand that holds the left bumper and moves one stick after the other, there and back."""
    moving_s = elapsed_s % (REST_S + ROUND_S) - REST_S
    if moving_s < 0:
        return dict.fromkeys((*_STICKS, "dpad_x", "a", "b", "left_bumper"), 0.0)
    phase = moving_s / ROUND_S * (len(_STICKS) + 2)
    turn, share = int(phase), phase % 1.0
    values = dict.fromkeys(_STICKS, 0.0) | {"dpad_x": 0.0, "a": 0.0, "b": 0.0, "left_bumper": 1.0}
    wave = math.sin(2 * math.pi * share)
    if turn < len(_STICKS):
        values[_STICKS[turn]] = 0.8 * wave
    elif turn == len(_STICKS):
        values["dpad_x"] = math.copysign(1.0, wave)
    else:
        values["a" if wave > 0 else "b"] = 1.0
    return values


MOTIONS = {"demonstration": demonstration}
