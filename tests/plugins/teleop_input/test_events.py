"""Codes, records and the headers of streams."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua_teleop_input.codes import AXES, BUTTONS, axis_name, button_name
from joshua_teleop_input.errors import InputDeviceError
from joshua_teleop_input.events import RECORD, AxisRange, Capabilities, EventDecoder
from joshua_teleop_input.remote_device import header_line, parse_header

HEADER = Path("/usr/include/linux/input-event-codes.h")


@pytest.mark.skipif(not HEADER.exists(), reason="the kernel's headers are not installed")
def test_the_codes_are_the_kernels() -> None:
    text = HEADER.read_text()
    kernel = dict(re.findall(r"#define\s+((?:ABS|BTN|KEY)_\w+)\s+(\w+)", text))

    def number(name: str) -> int:
        value = kernel[name]
        return number(value) if value in kernel else int(value, 0)

    for name, code in {**AXES, **BUTTONS}.items():
        assert number(name) == code, name


def test_codes_have_names() -> None:
    assert (axis_name(3), button_name(0x130), axis_name(0x3F)) == ("ABS_RX", "BTN_SOUTH", "ABS_63")


@given(
    st.lists(st.tuples(st.integers(0, 3), st.integers(0, 0x2FF), st.integers(-32768, 32767)), max_size=20),
    st.lists(st.integers(1, 40), min_size=1, max_size=30),
)
def test_records_survive_any_cutting(records: list[tuple[int, int, int]], cuts: list[int]) -> None:
    data = b"".join(RECORD.pack(1, 2, *record) for record in records)
    decoder, found = EventDecoder(), []
    while data:
        size = cuts[len(found) % len(cuts)]
        found += [(event.type, event.code, event.value) for event in decoder.feed(data[:size])]
        data = data[size:]
    assert found == records


DEVICE = Capabilities(
    "Pad", (3, 1, 2, 3), frozenset({304, 305}), frozenset({304}), {0: AxisRange(5, -10, 10, 1, 2)}
)


def test_a_header_says_what_a_device_has() -> None:
    assert parse_header(header_line(DEVICE), "pad.sock") == DEVICE


@given(st.binary(max_size=200))
def test_garbage_is_no_gamepad(data: bytes) -> None:
    with pytest.raises(InputDeviceError, match="is not a shared gamepad"):
        parse_header(data, "/tmp/x.sock")


@pytest.mark.parametrize(
    ("found", "replaced"),
    [('"keys": [304, 305]', '"keys": [3040]'), ('"0": [5', '"99": [5'), ('"held": [304]', '"held": 304')],
)
def test_impossible_facts_are_refused(found: str, replaced: str) -> None:
    line = header_line(DEVICE).decode().replace(found, replaced)
    assert replaced in line
    with pytest.raises(InputDeviceError, match="run joshua share-gamepad on the other machine"):
        parse_header(line.encode(), "/tmp/x.sock")


def test_another_version_is_named() -> None:
    line = header_line(DEVICE).replace(b'"version": 1', b'"version": 2')
    with pytest.raises(InputDeviceError, match="install the same joshua-teleop-input on both machines"):
        parse_header(line, "/tmp/x.sock")
