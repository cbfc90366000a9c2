"""The naming rules of ROS 2."""

from __future__ import annotations

import pytest
from joshua.config.names import (
    MAX_TOPIC_LENGTH,
    frame_fault,
    has_repeated_underscores,
    is_hidden,
    namespace_fault,
    node_name_fault,
    topic_fault,
)


@pytest.mark.parametrize(
    "name",
    [
        "/leader/joint_states",
        "joint_states",
        "~/command",
        "~",
        "/a",
        "a1/b_2",
        "/_hidden/x",
        "/A/B",
        "/" + "a" * 246,
    ],
)
def test_valid_topic_names(name: str) -> None:
    assert topic_fault(name) is None


@pytest.mark.parametrize(
    ("name", "rule", "offset", "length", "suggestion"),
    [
        ("/joint states", "only letters", 6, 1, "/joint_states"),
        ("/arm-left/x", "only letters", 4, 1, "/arm_left/x"),
        ("/größe", "only letters", 3, 2, "/gr_e"),
        ("/a/", "may not end with /", 2, 1, "/a"),
        ("/", "may not end with /", 0, 1, ""),
        ("/a//b", "may not contain //", 2, 2, "/a/b"),
        ("/2arm/x", "start with a digit", 1, 1, "/n2arm/x"),
        ("3d", "start with a digit", 0, 1, "n3d"),
        ("~foo", "~ must be followed by /", 0, 2, "~/foo"),
        ("/a/~/b", "only at the start", 3, 1, "/a/b"),
        ("/a/{node}/b", "braces", 3, 1, "/a/node/b"),
        ("", "may not be empty", 0, 1, ""),
        ("/" + "a" * 300, f"at most {MAX_TOPIC_LENGTH}", 247, 54, ""),
    ],
)
def test_broken_topic_names(name: str, rule: str, offset: int, length: int, suggestion: str) -> None:
    fault = topic_fault(name)
    assert fault is not None
    assert rule in fault.rule
    assert (fault.offset, fault.length, fault.suggestion) == (offset, length, suggestion)


@pytest.mark.parametrize(
    "suggested", [topic_fault(name) for name in ("/a b", "~x", "//", "/9/8", "a{b}c", "/é", "x/~")]
)
def test_a_suggested_topic_name_is_valid(suggested: object) -> None:
    text = getattr(suggested, "suggestion", "")
    assert text == "" or topic_fault(text) is None


@pytest.mark.parametrize("name", ["follower_arm", "a", "A1", "_private", "a__b"])
def test_valid_node_names(name: str) -> None:
    assert node_name_fault(name) is None


@pytest.mark.parametrize(
    ("name", "rule", "suggestion"),
    [
        ("left/arm", "ros_namespace", "arm"),
        ("follower-arm", "only letters", "follower_arm"),
        ("1st", "start with a digit", "n1st"),
        ("a" * 256, "at most 255", "a" * 247),
    ],
)
def test_broken_node_names(name: str, rule: str, suggestion: str) -> None:
    fault = node_name_fault(name)
    assert fault is not None
    assert rule in fault.rule
    assert fault.suggestion == suggestion


@pytest.mark.parametrize("name", ["/", "/left", "/left/arm_2"])
def test_valid_namespaces(name: str) -> None:
    assert namespace_fault(name) is None


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("left", "must start with /"),
        ("/left/", "may not end with /"),
        ("/a//b", "//"),
        ("/~", "~"),
        ("/1", "start with a digit"),
        ("/a b", "only letters"),
    ],
)
def test_broken_namespaces(name: str, rule: str) -> None:
    fault = namespace_fault(name)
    assert fault is not None
    assert rule in fault.rule


def test_frames() -> None:
    assert frame_fault("camera_top_optical_frame") is None
    assert frame_fault("a/b") is None
    assert frame_fault("/base").suggestion == "base"
    assert frame_fault("a b").suggestion == "a_b"


def test_hidden_and_reserved_names() -> None:
    assert is_hidden("/_x")
    assert is_hidden("/a/_b")
    assert not is_hidden("/a_/b")
    assert has_repeated_underscores("/a__b")
    assert not has_repeated_underscores("/a_b_c")
