"""What follows from an error of reading is not reported a second time; what does not follow is."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from joshua.plan import Diagnostic

CheckText = Callable[..., list[Diagnostic]]

FILE = """general {{
  mode: {mode}
}}
robot {{
  actions {{
    node {{
      node_name: "leader"
      node_id: 1
      {publishers} {{
        data_type: JOINT_STATE
        {topic}
        publish_rate_hz: 50
      }}
    }}
    action_type: ACTION_LEADER
    mock_motor_config {{ num_motors: 6 position_max: 4095 }}
  }}
  actions {{
    node {{
      node_name: "follower"
      node_id: 2
      subscriptions {{ data_type: JOINT_STATE topic_name: "/leader/joint_states" }}
    }}
    action_type: ACTION_FOLLOWER
    mock_motor_config {{ {motors} position_max: 4095 }}
  }}
}}
"""
GOOD = {
    "mode": "MODE_TELEOPERATE",
    "publishers": "publishers",
    "topic": 'topic_name: "/leader/joint_states"',
    "motors": "num_motors: 6",
}


def codes(check_text: CheckText, **changes: str) -> list[str]:
    return sorted(item.code for item in check_text(FILE.format(**{**GOOD, **changes})))


def test_the_file_is_good_as_it_is(check_text: CheckText) -> None:
    assert codes(check_text) == []


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        # A mistyped field is not missing as well.
        ({"motors": "num_moters: 6"}, ["unknown-field"]),
        ({"motors": "num_motors 6"}, ["missing-colon"]),
        ({"motors": "num_motors:\n"}, ["missing-value"]),
        ({"motors": 'num_motors: "six"'}, ["wrong-type"]),
        # A lost publisher leaves no follower without a leader.
        ({"publishers": "publisher"}, ["unknown-field"]),
        ({"topic": 'topic_nam: "/leader/joint_states"'}, ["unknown-field"]),
        ({"topic": 'topic_name "/leader/joint_states"'}, ["missing-colon"]),
        ({"topic": "topic_name: /leader/joint_states"}, ["unquoted-string"]),
        # An unknown mode is not a missing one.
        ({"mode": "MODE_TELEOP"}, ["unknown-enum-value"]),
    ],
)
def test_one_mistake_is_one_finding(
    changes: dict[str, str], expected: list[str], check_text: CheckText
) -> None:
    assert codes(check_text, **changes) == expected


def test_a_mistake_elsewhere_hides_nothing(check_text: CheckText) -> None:
    found = codes(check_text, motors="num_moters: 6 position_min: 9999", topic='topic_name: "/leader joint"')
    assert found == ["out-of-range", "topic-name-invalid", "unknown-field"]


def test_a_typo_in_one_block_leaves_absences_of_others(check_text: CheckText) -> None:
    text = FILE.format(**GOOD).replace("node_id: 2", "").replace("num_motors: 6", "num_moters: 6", 1)
    assert sorted((item.code, item.field_path) for item in check_text(text)) == [
        ("required-missing", "robot.actions[1].node.node_id"),
        ("unknown-field", "robot.actions[0].mock_motor_config.num_moters"),
    ]


def test_a_file_that_cannot_be_read_has_one_finding(check_text: CheckText) -> None:
    assert [item.code for item in check_text("general\0 {}")] == ["nul-byte"]


def test_a_missing_include_hides_what_it_may_have_held(check_text: CheckText) -> None:
    assert [item.code for item in check_text('include: "rest.pbtxt"\n')] == ["include-missing"]
