"""Names in the file: what is refused and how it is said."""

from __future__ import annotations

import pytest
from gamepads import JOINTS, NODE, PAIR, STICK, gamepad_settings, keyboard_settings
from joshua.plugins.settings import FieldError
from pydantic import ValidationError


def refusal(error: ValidationError) -> FieldError:
    (detail,) = error.errors()
    (found,) = detail["ctx"]["error"].errors
    assert isinstance(found, FieldError)
    return found


@pytest.mark.parametrize(
    ("block", "field", "nearest"),
    [
        (
            'controls { positive: "left_stick_x" joint: "pan" speed_rad_s: 1 }',
            "controls[0].positive",
            "left_stick",
        ),
        (
            STICK + 'controls { positive: "a" negative: "bb" joint: "pan" speed_rad_s: 1 }',
            "controls[1].negative",
            "",
        ),
        ('dead_man_button: "left_bumber"' + STICK, "dead_man_button", "left_bumper"),
        ('dead_man_button: "left_x"' + STICK, "dead_man_button", ""),
        ('enable_button: "strat"' + STICK, "enable_button", "start"),
        ('mapping { name: "z" source: "ABS_XX" }' + STICK, "mapping[0].source", "ABS_X"),
        (
            'mapping { name: "z" source: "ABS_X" } mapping { name: "z" source: "ABS_Y" }',
            "mapping[1].name",
            "",
        ),
        ('dead_man_button: "a" enable_button: "a"' + STICK, "enable_button", ""),
        ('dead_man_button: "a" release_button: "a"' + STICK, "release_button", ""),
        ('release_button: "bakc"' + STICK, "release_button", "back"),
        ('controls { positive: "left_x" joint: "pann" speed_rad_s: 1 }', "controls[0].joint", "pan"),
    ],
)
def test_a_wrong_name_is_found_with_the_nearest_one(block: str, field: str, nearest: str) -> None:
    with pytest.raises(ValidationError) as caught:
        gamepad_settings(block, joints=JOINTS)
    found = refusal(caught.value)
    assert found.field == field
    assert found.remedy
    if nearest:
        assert found.allowed[0] == nearest


def test_joints_that_are_not_known_yet_are_not_judged() -> None:
    assert gamepad_settings('controls { positive: "left_x" joint: "any" speed_rad_s: 1 }').joints == ()


def test_driving_needs_the_state_of_the_arm() -> None:
    with pytest.raises(ValidationError) as caught:
        gamepad_settings(
            node=NODE.replace("subscriptions", "publishers").replace('joint_states"', 'x" publish_rate_hz: 1')
        )
    assert "does not subscribe to their state" in str(refusal(caught.value))
    assert "subscriptions {" in refusal(caught.value).remedy


def test_a_joy_alone_needs_nothing() -> None:
    node = 'publishers { data_type: JOY topic_name: "/joy" publish_rate_hz: 20 }'
    assert gamepad_settings(PAIR, node=node).drives is False


@pytest.mark.parametrize(
    ("block", "field", "text"),
    [
        ('controls { positive: "dd" joint: "pan" speed_rad_s: 1 }', "controls[0].positive", "is not a key"),
        ('controls { positive: "spce" joint: "pan" speed_rad_s: 1 }', "controls[0].positive", "is not a key"),
        (
            'controls { positive: "d" negative: "D" joint: "p" speed_rad_s: 1 }',
            "controls[0].negative",
            "is already used in",
        ),
        ('controls { positive: "?" joint: "pan" speed_rad_s: 1 }', "controls[0].positive", "shows the help"),
        (
            'enable_key: "d" controls { positive: "d" joint: "p" speed_rad_s: 1 }',
            "enable_key",
            "is already used in",
        ),
    ],
)
def test_a_wrong_key_is_found(block: str, field: str, text: str) -> None:
    with pytest.raises(ValidationError) as caught:
        keyboard_settings(block)
    found = refusal(caught.value)
    assert found.field == field
    assert text in str(found)


def test_the_nearest_key_is_named() -> None:
    with pytest.raises(ValidationError) as caught:
        keyboard_settings('enable_key: "spacebar"')
    assert refusal(caught.value).allowed[1] == "space"
