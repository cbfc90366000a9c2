"""The emulated camera as a process: its HTTP, its pace, its faults, its end."""

from __future__ import annotations

import io
import itertools
import socket
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from joshua_emulator import EmulatedCamera, EmulatorError
from joshua_emulator.camera.frame_code import FrameCode, read_code
from PIL import Image

LONG_S = 30.0


class Stream:
    """A client of its own: parts of multipart/x-mixed-replace, read by their announced length."""

    def __init__(self, camera: EmulatedCamera) -> None:
        self.response = urllib.request.urlopen(camera.source, timeout=LONG_S)
        assert self.response.headers["Content-Type"].startswith("multipart/x-mixed-replace; boundary=")

    def part(self) -> bytes:
        while (line := self.response.readline()) != b"--joshua-camera-frame\r\n":
            assert line in (b"\r\n",), line
        length = 0
        while line := self.response.readline().strip():
            name, _, value = line.partition(b":")
            if name.lower() == b"content-length":
                length = int(value)
        data = self.response.read(length)
        assert len(data) == length
        return bytes(data)

    def code(self) -> FrameCode:
        found = read_code(pixels(self.part()))
        assert found is not None
        return found

    def close(self) -> None:
        self.response.close()


def pixels(frame: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(frame)).convert("RGB"))


@pytest.fixture(scope="module")
def process() -> Iterator[EmulatedCamera]:
    with EmulatedCamera(320, 240, 50) as process:
        yield process


@pytest.fixture
def camera(process: EmulatedCamera) -> Iterator[EmulatedCamera]:
    yield process
    process.ask("clear_faults")


@pytest.fixture
def stream(camera: EmulatedCamera) -> Iterator[Stream]:
    stream = Stream(camera)
    yield stream
    stream.close()


def test_frames_come_in_order_and_on_time(camera: EmulatedCamera, stream: Stream) -> None:
    codes = [stream.code() for _ in range(40)]
    numbers = [code.number for code in codes]
    assert numbers == sorted(set(numbers))
    sent = camera.sent()
    assert all(code.sent_ns <= sent[code.number] for code in codes)
    held_up_s = camera.ask("lateness")["max_s"]
    for first, second in itertools.pairwise(codes):
        # every frame is as far from another as their numbers say, give or take what held the process up
        apart_s = (second.sent_ns - first.sent_ns) / 1e9
        assert apart_s == pytest.approx((second.number - first.number) / 50, abs=0.05 + held_up_s)


def test_two_clients_get_the_same_frames(camera: EmulatedCamera, stream: Stream) -> None:
    other = Stream(camera)
    second = [other.code().number for _ in range(20)]
    first = [stream.code().number]
    while first[-1] < second[-1]:  # the older client has more to read before it comes to the same frames
        first.append(stream.code().number)
    other.close()
    assert set(first) & set(second)
    assert camera.ask("state")["streams"] >= 1


def test_one_picture(camera: EmulatedCamera) -> None:
    with urllib.request.urlopen(camera.picture, timeout=LONG_S) as answer:
        assert answer.headers["Content-Type"] == "image/jpeg"
        assert pixels(answer.read()).shape == (240, 320, 3)


@pytest.mark.parametrize(
    ("request_line", "status", "hint"),
    [
        (b"GET /video HTTP/1.1\r\n\r\n", b"404 Not Found", b"allowed: /, /stream.mjpg, /picture.jpg"),
        (b"POST / HTTP/1.1\r\n\r\n", b"405 Method Not Allowed", b"allowed: GET, HEAD"),
        (b"hello\r\n\r\n", b"400 Bad Request", b"no HTTP/1 request"),
        (b"GET / HTTP/1.1\r\nX: " + b"x" * 20_000, b"431 Request Header", b"too long"),
        (b"HEAD / HTTP/1.1\r\n\r\n", b"200 OK", b"multipart/x-mixed-replace"),
        (b"HEAD /picture.jpg HTTP/1.1\r\n\r\n", b"200 OK", b"close\r\n\r\n"),
    ],
)
def test_other_requests_are_answered(
    camera: EmulatedCamera, request_line: bytes, status: bytes, hint: bytes
) -> None:
    with socket.create_connection(("127.0.0.1", camera.ready["port"]), LONG_S) as client:
        client.sendall(request_line)
        answer = b""
        while data := _receive(client):
            answer += data
    assert status in answer
    assert hint in answer
    assert not request_line.startswith(b"HEAD") or answer.endswith(b"\r\n\r\n")


def _receive(client: socket.socket) -> bytes:
    try:
        return client.recv(65536)
    except ConnectionResetError:  # the camera has closed with our bytes unread
        return b""


def test_a_stall_pauses_the_stream_and_numbers_go_on(camera: EmulatedCamera, stream: Stream) -> None:
    before = stream.code().number
    camera.fault("stall", 0.4)
    camera.wait_for(["go_on"])
    stall, go_on = camera.log("stall")[-1], camera.log("go_on")[-1]
    assert go_on["t_ns"] - stall["t_ns"] >= 0.4e9
    assert not [t for t in camera.sent().values() if stall["t_ns"] < t < go_on["t_ns"]]
    numbers = [stream.code().number for _ in range(30)]
    assert numbers == sorted(set(numbers))
    assert max(numbers) > before + 20


def test_unplug_cuts_off_and_replug_serves_the_same_address(camera: EmulatedCamera, stream: Stream) -> None:
    stream.code()
    camera.fault("unplug")
    with pytest.raises((OSError, AssertionError)):
        _read_on(stream)
    with pytest.raises((urllib.error.URLError, ConnectionError)):
        Stream(camera)
    camera.fault("replug")
    again = Stream(camera)
    assert again.code().number > 0
    again.close()


def _read_on(stream: Stream) -> None:
    while True:
        stream.part()


def test_unplug_with_a_time_for_the_replug(camera: EmulatedCamera) -> None:
    first = camera.log("plug")[-1]["sequence"]
    camera.fault("unplug", replug_after_s=0.05)
    assert camera.wait_for(["plug"], since=first)["port"] == camera.ready["port"]


def test_another_size_and_another_rate(camera: EmulatedCamera, stream: Stream) -> None:
    camera.ask("fault", kind="size", value="160x120")
    while pixels(stream.part()).shape != (120, 160, 3):
        pass
    camera.fault("rate", 200)
    assert camera.ask("state")["fps"] == 200
    camera.ask("clear_faults")
    state = camera.ask("state")
    assert (state["width"], state["height"], state["fps"]) == (320, 240, 50)
    while pixels(stream.part()).shape != (240, 320, 3):
        pass


def test_corrupt_and_cut_off_frames(camera: EmulatedCamera, stream: Stream) -> None:
    camera.fault("truncate", 1)
    while stream.part().endswith(b"\xff\xd9"):
        pass
    camera.ask("clear_faults")
    camera.fault("corrupt", 1)
    deadline_s = time.monotonic() + LONG_S
    while not _damaged(stream.part()):
        assert time.monotonic() < deadline_s
    counts = camera.ask("state")["fault_counts"]
    assert counts["truncate"] > 0
    assert counts["corrupt"] > 0


def _damaged(frame: bytes) -> bool:
    try:
        return read_code(pixels(frame)) is None
    except OSError:
        return True


def test_dropped_frames_leave_gaps(camera: EmulatedCamera, stream: Stream) -> None:
    camera.fault("drop", 0.5)
    begun = camera.ask("state")["number"]
    while (number := stream.code().number) < begun:  # what was on its way before
        pass
    numbers = [number, *(stream.code().number for _ in range(39))]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] - numbers[0] > 45


def test_a_client_that_does_not_read_misses_frames(camera: EmulatedCamera) -> None:
    with socket.socket() as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.connect(("127.0.0.1", camera.ready["port"]))
        client.sendall(b"GET / HTTP/1.1\r\n\r\n")
        camera.fault("rate", 400)
        camera.wait_for(["skipped"], timeout_s=LONG_S)


def test_a_fault_can_be_set_at_the_start() -> None:
    with EmulatedCamera(160, 120, 100, fault=["unplug,at_s=0.05", "corrupt=0.25"]) as camera:
        camera.wait_for(["unplug"])
        assert camera.ask("state")["faults"]["corrupt"] == 0.25


@pytest.mark.parametrize(
    ("operation", "values", "message"),
    [
        ("dance", {}, "unknown operation 'dance'; allowed: state, log"),
        ("fault", {"kind": "melt"}, "unknown fault 'melt'; allowed: drop, corrupt, truncate, stall"),
        ("fault", {"kind": "corrupt", "value": 2}, "corrupt is 2; allowed: a probability from 0 to 1"),
        ("fault", {"kind": "corrupt"}, "corrupt needs a value"),
        ("fault", {"kind": "size", "value": "big"}, "size is 'big'; allowed: WIDTHxHEIGHT"),
        ("fault", {"kind": "size", "value": "10x10"}, "no room for the frame code"),
        ("fault", {"kind": "rate", "value": 0}, "rate is 0; allowed: above 0, at most 1000 Hz"),
        ("fault", {"kind": "rate", "value": "fast"}, "rate is 'fast'; allowed: above 0"),
    ],
)
def test_requests_that_cannot_be_carried_out(
    camera: EmulatedCamera, operation: str, values: dict[str, Any], message: str
) -> None:
    with pytest.raises(EmulatorError, match=message):
        camera.ask(operation, **values)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"width": 20, "height": 20}, "no room for the frame code"),
        ({"fps": 0}, "expected frames per second above 0, at most 1000, found '0'"),
        ({"fault": ["size=1"]}, "allowed: WIDTHxHEIGHT"),
    ],
)
def test_a_camera_that_cannot_start_says_why(options: dict[str, Any], message: str) -> None:
    with pytest.raises(EmulatorError, match=message):
        EmulatedCamera(**options).start()


def test_a_port_that_is_taken_is_named(camera: EmulatedCamera) -> None:
    second = EmulatedCamera(160, 120, 30, port=camera.ready["port"])
    with pytest.raises(EmulatorError, match="Address already in use"):
        second.start()


def test_the_process_ends_on_request() -> None:
    with EmulatedCamera(160, 120, 30) as camera:
        camera.ask("quit")
        assert camera._process is not None
        assert camera._process.wait(LONG_S) == 0
