"""Names of sticks and buttons on several makers' devices."""

from __future__ import annotations

from gamepads import gamepad_settings
from hypothesis import given
from hypothesis import strategies as st
from joshua_teleop_input.codes import AXES, BUTTONS, EV_ABS, EV_KEY
from joshua_teleop_input.event_pad import layout_for
from joshua_teleop_input.events import AxisRange, Capabilities, InputEvent
from joshua_teleop_input.layout import present, standard_layout
from joshua_teleop_input.pad_state import JOY_AXES, PadState, StateTracker, joy_values

FULL = AxisRange(0, -32768, 32767)
TRIGGER = AxisRange(0, 0, 255)
HAT = AxisRange(0, -1, 1)


def device(buttons: str, axes: dict[str, AxisRange], vendor: int = 0x045E) -> Capabilities:
    return Capabilities(
        "Pad",
        (3, vendor, 1, 1),
        frozenset(BUTTONS[f"BTN_{name}"] for name in buttons.split()),
        axes={AXES[f"ABS_{name}"]: limits for name, limits in axes.items()},
    )


XBOX = device(
    "A B X Y TL TR SELECT START MODE THUMBL THUMBR",
    {"X": FULL, "Y": FULL, "RX": FULL, "RY": FULL, "Z": TRIGGER, "RZ": TRIGGER, "HAT0X": HAT, "HAT0Y": HAT},
)
WIRELESS = device(
    "SOUTH EAST NORTH WEST TL TR",
    {"X": FULL, "Y": FULL, "Z": FULL, "RZ": FULL, "GAS": TRIGGER, "BRAKE": TRIGGER},
)
SONY = device("SOUTH EAST NORTH WEST", {"X": TRIGGER, "Y": TRIGGER}, vendor=0x054C)


def states(pad: Capabilities, *events: tuple[int, str, int]) -> PadState:
    tracker = StateTracker(pad, present(standard_layout(pad), pad))
    for kind, name, value in events:
        tracker.take(InputEvent(kind, AXES[name] if kind == EV_ABS else BUTTONS[name], value))
    return tracker.state()


@given(st.sampled_from([XBOX, WIRELESS, SONY]), st.integers(-40000, 40000), st.sampled_from(sorted(AXES)))
def test_values_stay_in_range(pad: Capabilities, value: int, axis: str) -> None:
    state = states(pad, (EV_ABS, axis, value))
    assert all(-1.0 <= number <= 1.0 for number in state.values.values())


def test_right_and_up_are_positive() -> None:
    state = states(XBOX, (EV_ABS, "ABS_X", 32767), (EV_ABS, "ABS_Y", -32768), (EV_ABS, "ABS_HAT0Y", -1))
    assert (state.value("left_x"), state.value("left_y"), state.value("dpad_y")) == (1.0, 1.0, 1.0)
    assert state.pressed("dpad_up")
    assert not state.pressed("dpad_down")


def test_a_trigger_rests_at_nothing() -> None:
    assert states(XBOX).value("left_trigger") == 0.0
    assert states(XBOX, (EV_ABS, "ABS_Z", 255)).value("left_trigger") == 1.0


def test_wireless_controllers_have_the_right_stick_elsewhere() -> None:
    layout = standard_layout(WIRELESS)
    assert layout["right_x"].code == AXES["ABS_Z"]
    assert layout["right_trigger"].code == AXES["ABS_GAS"]


def test_the_left_button_is_x_on_every_maker() -> None:
    assert standard_layout(XBOX)["x"].code == BUTTONS["BTN_X"]
    assert standard_layout(SONY)["x"].code == BUTTONS["BTN_WEST"]


def test_the_mapping_of_a_file_comes_first() -> None:
    block = """mapping { name: "right_y" source: "ABS_RZ" }
      mapping { name: "pedal" source: "BTN_TR" inverted: true }
      controls { positive: "pedal" joint: "pan" speed_rad_s: 1 }"""
    layout = layout_for(XBOX, gamepad_settings(block))
    assert layout["right_y"].code == AXES["ABS_RZ"]
    assert layout["right_y"].value({5: FULL}, {5: -32768}, ()) == 1.0
    assert layout["pedal"].value({}, {}, ()) == 1.0
    assert layout["pedal"].value({}, {}, (BUTTONS["BTN_TR"],)) == 0.0


def test_joy_has_the_order_and_the_signs_of_game_controller_node() -> None:
    state = states(
        XBOX,
        (EV_ABS, "ABS_X", 32767),
        (EV_ABS, "ABS_RY", -32768),
        (EV_ABS, "ABS_RZ", 255),
        (EV_KEY, "BTN_X", 1),
        (EV_KEY, "BTN_TL", 1),
        (EV_ABS, "ABS_HAT0X", -1),
    )
    axes, buttons = joy_values(state, 0.0)
    assert JOY_AXES == ("left_x", "left_y", "right_x", "right_y", "left_trigger", "right_trigger")
    assert [round(value, 3) for value in axes] == [-1.0, 0.0, 0.0, 1.0, 0.0, -1.0]
    assert len(buttons) == 21
    assert [index for index, value in enumerate(buttons) if value] == [2, 9, 13]


def test_a_device_that_is_not_trusted_is_released() -> None:
    axes, buttons = joy_values(PadState({"left_x": 1.0, "a": 1.0}, live=False), 0.1)
    assert not any(axes)
    assert not any(buttons)
