"""States from the kernel's records: reports, and what follows when records were lost."""

from __future__ import annotations

from dataclasses import replace

from gamepads import STICK, gamepad_settings
from joshua_teleop_input.codes import AXES, BUTTONS, EV_ABS, EV_KEY, EV_SYN, SYN_DROPPED, SYN_REPORT
from joshua_teleop_input.event_pad import EventPad
from joshua_teleop_input.events import AxisRange, Capabilities, InputEvent
from joshua_teleop_input.pad_state import PadState

A, X = BUTTONS["BTN_A"], AXES["ABS_X"]
DEVICE = Capabilities("Pad", keys=frozenset({A}), axes={X: AxisRange(0, -100, 100)})
REPORT = InputEvent(EV_SYN, SYN_REPORT, 0)
DROPPED = InputEvent(EV_SYN, SYN_DROPPED, 0)


class Kernel:
    """What the kernel hands over, call by call."""

    path = "/dev/input/event0"
    silence_limit_s: float | None = None

    def __init__(self, *batches: list[InputEvent], now: Capabilities = DEVICE) -> None:
        self.capabilities = DEVICE
        self._batches = list(batches)
        self._now = now

    def grab(self) -> None:
        """Does nothing."""

    def read(self, timeout_s: float) -> list[InputEvent]:
        del timeout_s
        return self._batches.pop(0) if self._batches else []

    def resynchronise(self) -> Capabilities:
        return self._now

    def close(self) -> None:
        """Does nothing."""


def states(kernel: Kernel) -> list[PadState]:
    pad = EventPad(kernel, gamepad_settings(STICK))
    found = []
    for _ in range(5):
        found += pad.read(0.0)
    return found


def test_a_report_makes_one_state_of_all_its_records() -> None:
    kernel = Kernel([InputEvent(EV_ABS, X, 50), InputEvent(EV_KEY, A, 1)], [REPORT, REPORT])
    first, second = states(kernel)
    assert not any(first.values.values())
    assert (second.value("left_x"), second.pressed("a")) == (0.5, True)


def test_the_repetition_of_a_button_is_no_release() -> None:
    kernel = Kernel([InputEvent(EV_KEY, A, 1), REPORT, InputEvent(EV_KEY, A, 2), REPORT])
    assert [state.pressed("a") for state in states(kernel)] == [False, True, True]


def test_lost_records_release_everything_before_the_truth_is_asked() -> None:
    now = replace(DEVICE, held=frozenset({A}), axes={X: AxisRange(-100, -100, 100)})
    kernel = Kernel([InputEvent(EV_ABS, X, 100), REPORT, DROPPED, InputEvent(EV_ABS, X, 7), REPORT], now=now)
    _, deflected, released, truth = states(kernel)
    assert deflected.value("left_x") == 1.0
    assert not released.live
    assert released.value("left_x") == 0.0
    assert (truth.live, truth.value("left_x"), truth.pressed("a")) == (True, -1.0, True)


def test_unknown_codes_change_nothing() -> None:
    kernel = Kernel([InputEvent(EV_ABS, 0x3F, 5), InputEvent(4, 4, 9), REPORT])
    assert all(not any(state.values.values()) for state in states(kernel))
