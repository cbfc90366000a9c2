from __future__ import annotations

import pytest
from joshua.plan.diagnostic import as_instruction, as_sentence


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("leader_arm has no motors", "leader_arm has no motors."),
        ("Did you mean this?", "Did you mean this?"),
        ("It is so.", "It is so."),
    ],
)
def test_a_message_ends_as_a_sentence(text: str, sentence: str) -> None:
    assert as_sentence(text) == sentence


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("swap the two values", "Swap the two values."),
        ("pip install joshua-camera", "pip install joshua-camera."),
        ("position_max is the one to raise", "position_max is the one to raise."),
        ("/dev/video0 is free", "/dev/video0 is free."),
        ("", ""),
    ],
)
def test_a_remedy_begins_and_ends_as_a_sentence(text: str, sentence: str) -> None:
    assert as_instruction(text) == sentence
