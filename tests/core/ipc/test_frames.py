"""Frames over a socket pair: cut anywhere, queued when the other side does not read, with descriptors."""

from __future__ import annotations

import os
import socket

import pytest
from joshua.ipc.frames import HEADER, MAX_FRAME_BYTES, EndOfStreamError, FrameError, FrameSocket


@pytest.fixture
def pair():
    left, right = socket.socketpair()
    ends = FrameSocket(left), FrameSocket(right)
    yield ends
    for end in ends:
        end.close()


@pytest.fixture
def raw():
    left, right = socket.socketpair()
    end = FrameSocket(right)
    yield left, end
    left.close()
    end.close()


def test_frames_arrive_whole_and_in_order(pair):
    left, right = pair
    for payload in (b"one", b"", b"three" * 1000):
        assert left.send(payload)

    assert right.receive() == [b"one", b"", b"three" * 1000]
    assert right.receive() == []


def test_a_frame_that_comes_byte_by_byte_is_put_together(raw):
    sender, end = raw
    frames = []
    for byte in HEADER.pack(5) + b"hello":
        sender.send(bytes([byte]))
        frames += end.receive()
    assert frames == [b"hello"]


def test_what_the_socket_does_not_take_is_queued_and_flushed(pair):
    left, right = pair
    payload = os.urandom(300_000)
    sent = [left.send(payload) for _ in range(8)]
    assert sent[-1] is False
    assert left.pending_bytes > 0

    received = []
    while len(received) < 8:
        received += right.receive()
        left.flush()
    assert received == [payload] * 8
    assert left.pending_bytes == 0


def test_descriptors_travel_with_their_frame(pair):
    left, right = pair
    reading, writing = os.pipe()
    left.send(b"first", (writing,))
    left.send(b"second", (reading, writing))
    os.close(writing)
    frames = []
    while len(frames) < 2:
        frames += right.receive()

    one = right.take_descriptors(1)
    two, three = right.take_descriptors(2)
    os.write(one[0], b"x")
    assert os.read(two, 1) == b"x"
    for descriptor in (reading, one[0], two, three):
        os.close(descriptor)
    with pytest.raises(FrameError, match="1 descriptors were announced, 0 have arrived"):
        right.take_descriptors(1)


def test_a_length_out_of_range_is_an_error(raw):
    sender, end = raw
    sender.send(HEADER.pack(MAX_FRAME_BYTES + 1))
    with pytest.raises(FrameError, match="at most"):
        end.receive()


def test_the_end_of_the_other_side_is_told_on_both_ways(raw):
    sender, end = raw
    sender.close()
    with pytest.raises(EndOfStreamError):
        end.receive()
    with pytest.raises(EndOfStreamError):
        end.send(b"anybody there")


def test_what_was_said_before_the_end_is_still_heard(pair):
    left, right = pair
    left.send(b"last words")
    left.close()
    assert right.receive() == [b"last words"]
    with pytest.raises(EndOfStreamError):
        right.receive()
