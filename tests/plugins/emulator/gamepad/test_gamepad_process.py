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
        self.socket.settimeout(60)
        self.socket.connect(pad.device)
        self.data = b""
        self.stamps_ns: list[int] = []  # of all records so far, by the clock of the machine
        while b"\n" not in self.data:
            self.data += self.socket.recv(4096)
        line, _, self.data = self.data.partition(b"\n")
        self.header = json.loads(line)

    def records(self, until: object) -> list[tuple[int, int, int]]:
        """Reads records until one fits."""
        found: list[tuple[int, int, int]] = []
        deadline_s = time.monotonic() + 60
        while time.monotonic() < deadline_s:
            while len(self.data) >= RECORD.size:
                seconds, microseconds, *rest = RECORD.unpack(self.data[: RECORD.size])
                self.stamps_ns.append(seconds * 10**9 + microseconds * 1000)
                record = (rest[0], rest[1], rest[2])
                self.data = self.data[RECORD.size :]
                found.append(record)
                if until(record):  # type: ignore[operator]
                    return found
            piece = self.socket.recv(4096)
            if not piece:
                raise ConnectionError("the stream has ended")
            self.data += piece
        raise AssertionError(found)

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
    deadline_s = time.monotonic() + 60
    while not any([BUTTONS["left_bumper"], 1] in entry["changes"] for entry in pad.log("report")[-1:]):
        assert time.monotonic() < deadline_s
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
    client.records(lambda _: True)
    pad.fault("stall", 0.4)
    stall = pad.log("stall")[-1]
    go_on = pad.wait_for(["go_on"], since=stall["sequence"])
    epoch_ns = time.time_ns() - time.monotonic_ns()
    began_ns, ended_ns = stall["t_ns"] + epoch_ns, go_on["t_ns"] + epoch_ns
    client.records(lambda _: client.stamps_ns[-1] > ended_ns)
    client.close()
    assert ended_ns - began_ns >= 0.4e9
    assert client.stamps_ns[0] < began_ns
    assert not [stamp for stamp in client.stamps_ns if began_ns + 1e6 < stamp < ended_ns - 1e6]


@pytest.mark.parametrize(
    ("request_", "problem"),
    [
        (
            {"op": "fault", "kind": "melt"},
            "unknown fault 'melt'; allowed: stall, unplug, replug, rate, dirty, drop",
        ),
        ({"op": "fault", "kind": "rate", "value": 0}, "rate is 0; allowed: above 0, at most 1000 Hz"),
        ({"op": "fault", "kind": "rate"}, "rate needs a value, as in rate=…: above 0"),
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
