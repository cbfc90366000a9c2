"""From terminal bytes to held keys."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua_teleop_input.key_decoder import KeyDecoder, KeyEvent, Kind
from joshua_teleop_input.key_tracker import SILENCE_LIMIT_S, KeyTracker


def press(name: str) -> KeyEvent:
    return KeyEvent(Kind.PRESS, name, name)


@pytest.mark.parametrize(
    ("data", "events"),
    [
        (b"dD ", [press("d"), press("d"), press("space")]),
        (b"\r\t\x7f", [press("enter"), press("tab"), press("backspace")]),
        ("é".encode(), [press("é")]),
        (b"\x1b[A\x1bOB\x1b[5~\x1b[1;2C", [press("up"), press("down"), press("page_up"), press("right")]),
        (b"\x1b[15~\x1bOP", [press("f5"), press("f1")]),
        (b"\x1bd", [press("escape"), press("d")]),
        (b"\x01\x00", []),
        (b"\xff\xfed", [press("d")]),
        (b"\x1b[?15u", [KeyEvent(Kind.REPORTS_RELEASES)]),
        (b"\x1b[?62;22c", []),
        (b"\x1b[I\x1b[O", [KeyEvent(Kind.FOCUS_LOST)]),
        (b"\x1b[100u", [press("d")]),
        (b"\x1b[100;1:2u\x1b[100;1:3u", [KeyEvent(Kind.REPEAT, "d", "d"), KeyEvent(Kind.RELEASE, "d", "d")]),
        (b"\x1b[61:43;2u", [KeyEvent(Kind.PRESS, "+", "=")]),
        (b"\x1b[61;1:3u", [KeyEvent(Kind.RELEASE, "=", "=")]),
        (b"\x1b[99;5u", [KeyEvent(Kind.INTERRUPT)]),
        (b"\x1b[100;3u\x1b[100;9u", []),
        (b"\x1b[57441;2u\x1b[57358u", []),
        (b"\x1b[57400u\x1b[57419;1:3u", [press("1"), KeyEvent(Kind.RELEASE, "up", "up")]),
        (b"\x1b[1;1:3A", [KeyEvent(Kind.RELEASE, "up", "up")]),
        (b"\x1b[32;129u", [press("space")]),
    ],
)
def test_bytes_become_keys(data: bytes, events: list[KeyEvent]) -> None:
    assert KeyDecoder().feed(data) == events
    one_by_one = KeyDecoder()
    assert [event for byte in data for event in one_by_one.feed(bytes([byte]))] == [
        event for event in events if not (data == b"\x1bd" and event.key == "")
    ]


def test_escape_alone_is_a_key_when_nothing_follows() -> None:
    decoder = KeyDecoder()
    assert decoder.feed(b"\x1b") == []
    assert decoder.waiting
    assert decoder.flush() == [press("escape")]
    assert decoder.flush() == []


@given(st.binary(max_size=300), st.integers(1, 7))
def test_no_bytes_stop_the_decoder(data: bytes, size: int) -> None:
    decoder = KeyDecoder()
    for start in range(0, len(data), size):
        decoder.feed(data[start : start + size])
    decoder.flush()
    assert decoder.feed(b"d")[-1:] == [press("d")] or decoder.feed(b"d") == [press("d")]


def test_a_key_is_released_by_time() -> None:
    tracker = KeyTracker(0.15)
    tracker.take(press("d"), 1.0)
    assert tracker.held(1.1) == {"d"}
    tracker.take(press("d"), 1.1)
    assert tracker.held(1.2) == {"d"}
    assert tracker.held(1.3) == frozenset()


def test_two_keys_are_held_at_once() -> None:
    tracker = KeyTracker(0.15)
    tracker.reports_releases = True
    tracker.take(press("d"), 1.0)
    tracker.take(press("w"), 1.5)
    assert tracker.held(1.9) == {"d", "w"}
    tracker.take(KeyEvent(Kind.RELEASE, "d", "d"), 2.0)
    assert tracker.held(2.0) == {"w"}


def test_a_shifted_key_is_released_whatever_shift_does() -> None:
    tracker = KeyTracker(0.15)
    tracker.reports_releases = True
    tracker.take(KeyEvent(Kind.PRESS, "+", "="), 1.0)
    tracker.take(KeyEvent(Kind.RELEASE, "=", "="), 1.1)
    assert tracker.held(1.1) == frozenset()


def test_lost_releases_do_not_keep_a_key() -> None:
    tracker = KeyTracker(0.15)
    tracker.reports_releases = True
    tracker.take(press("d"), 1.0)
    assert tracker.held(1.0 + SILENCE_LIMIT_S + 0.01) == frozenset()
    tracker.take(press("d"), 3.0)
    tracker.take(KeyEvent(Kind.FOCUS_LOST), 3.1)
    assert tracker.held(3.1) == frozenset()
