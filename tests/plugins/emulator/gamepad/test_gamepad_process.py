"""The emulated gamepad as a client sees it, byte by byte."""

from __future__ import annotations

import json
import socket
import struct
import time
from collections.abc import Iterator

import pytest
from joshua_emulator import EmulatedGamepad, EmulatorError
from joshua_emulator.gamepad.hand import REST_S, ROUND_S, demonstration
from joshua_emulator.gamepad.xbox import BUTTONS, NAMES, axis_counts

RECORD = struct.Struct("<qqHHi")


@pytest.fixture(scope="module")
def process() -> Iterator[EmulatedGamepad]:
    with EmulatedGamepad() as started:
        yield started


@pytest.fixture
def pad(process: EmulatedGamepad) -> Iterator[EmulatedGamepad]:
    yield process
    process.ask("clear_faults")
    process.ask("motion", kind="")


class Client:
    """Reads the stream."""

    def __init__(self, pad: EmulatedGamepad) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.settimeout(10)
        self.socket.connect(pad.device)
        self.data = b""
        while b"\n" not in self.data:
            self.data += self.socket.recv(4096)
        line, _, self.data = self.data.partition(b"\n")
        self.header = json.loads(line)

    def records(self, until: object) -> list[tuple[int, int, int]]:
        """Reads records until one fits."""
        found: list[tuple[int, int, int]] = []
        deadline_s = time.monotonic() + 10
        while time.monotonic() < deadline_s:
            while len(self.data) >= RECORD.size:
                record = RECORD.unpack(self.data[: RECORD.size])[2:]
                self.data = self.data[RECORD.size :]
                found.append(record)
                if until(record):  # type: ignore[operator]
                    return found
            piece = self.socket.recv(4096)
            if not piece:
                raise ConnectionError("the stream has ended")
            self.data += piece
        raise AssertionError(found)

    def drain(self) -> None:
        """Reads until nothing comes in time."""
        while self.socket.recv(4096):
            pass

    def close(self) -> None:
        self.socket.close()


def test_the_header_answers_what_a_driver_asks(pad: EmulatedGamepad) -> None:
    client = Client(pad)
    assert client.header["format"] == "joshua-gamepad"
    assert set(client.header["keys"]) == set(BUTTONS.values())
    assert client.header["axes"]["0"][1:5] == [-32768, 32767, 16, 128]
    assert client.header["held"] == []
    client.close()


def test_changes_are_reported_once_and_end_with_a_report(pad: EmulatedGamepad) -> None:
    client = Client(pad)
    pad.set(left_y=1.0, a=1)
    records = client.records(lambda record: record == (1, 0x130, 1))
    assert (3, 1, -32768) in records
    assert client.records(lambda record: record[0] == 0)[-1] == (0, 0, 0)
    assert all(record == (0, 0, 0) for record in client.records(lambda record: record[0] == 0))
    client.close()


def test_a_dirty_start_is_in_the_header(pad: EmulatedGamepad) -> None:
    pad.fault("dirty")
    time.sleep(0.05)
    client = Client(pad)
    assert BUTTONS["left_bumper"] in client.header["held"]
    assert client.header["axes"]["0"][0] == 32767
    client.close()


def test_unplugging_cuts_a_record_in_two(pad: EmulatedGamepad) -> None:
    client = Client(pad)
    pad.fault("unplug", replug_after_s=0.2)
    with pytest.raises(ConnectionError):
        client.records(lambda _: False)
    assert len(client.data) == RECORD.size // 2
    client.close()
    pad.wait_for(["plug"], since=pad.log("unplug")[-1]["sequence"])
    Client(pad).close()


def test_a_stall_is_silence(pad: EmulatedGamepad) -> None:
    client = Client(pad)
    pad.fault("stall", 0.4)
    time.sleep(0.1)
    client.socket.settimeout(0.05)
    with pytest.raises(TimeoutError):
        client.drain()
    client.socket.settimeout(5)
    assert client.socket.recv(4096)
    client.close()


@pytest.mark.parametrize(
    ("request_", "problem"),
    [
        (
            {"op": "fault", "kind": "melt"},
            "unknown fault 'melt'; allowed: stall, unplug, replug, rate, dirty, drop",
        ),
        ({"op": "fault", "kind": "rate", "value": 0}, "rate is 0; allowed: above 0, at most 1000 Hz"),
        ({"op": "fault", "kind": "rate"}, "'value' is missing"),
        ({"op": "set", "values": {"left_z": 1}}, "unknown axis or button 'left_z'; allowed: left_x"),
        ({"op": "set", "values": {"left_x": 2}}, "left_x is 2; allowed: -1 to 1"),
        ({"op": "motion", "kind": "dance"}, "unknown motion 'dance'; allowed: demonstration"),
        ({"op": "fly"}, "unknown operation 'fly'; allowed: state"),
    ],
)
def test_a_wrong_request_says_what_is_allowed(
    pad: EmulatedGamepad, request_: dict[str, object], problem: str
) -> None:
    operation = str(request_.pop("op"))
    with pytest.raises(EmulatorError, match=problem.replace("'", ".")):
        pad.ask(operation, **request_)


def test_a_wrong_option_ends_the_start() -> None:
    with pytest.raises(EmulatorError, match=r"unknown motion .dance."), EmulatedGamepad(motion="dance"):
        pass


def test_the_demonstration_rests_between_its_rounds() -> None:
    for moment in (0.0, REST_S / 2, REST_S + ROUND_S + REST_S / 2):
        assert not any(demonstration(moment).values())
    moving = [demonstration(REST_S + ROUND_S * share / 100) for share in range(100)]
    assert all(values["left_bumper"] == 1.0 for values in moving)
    for name in ("left_x", "right_y", "dpad_x"):
        assert min(values[name] for values in moving) < 0 < max(values[name] for values in moving)
    assert all(set(values) <= set(NAMES) for values in moving)


def test_an_axis_counts_like_the_device() -> None:
    assert (axis_counts("left_x", -1), axis_counts("left_y", 1), axis_counts("right_trigger", 1)) == (
        *(-32768, -32768),
        255,
    )
