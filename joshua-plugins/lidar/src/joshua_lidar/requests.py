"""Requests and replies of RPLIDAR and YDLIDAR scanners, which share one format."""

from __future__ import annotations

import time
from functools import reduce
from operator import xor
from typing import NamedTuple

from joshua.api.clocks import AwakeClock
from joshua_serial.port import SerialPort

STOP, RESET, SCAN, EXPRESS_SCAN = 0x25, 0x40, 0x20, 0x82
GET_INFO, GET_HEALTH, GET_CONF = 0x50, 0x52, 0x84
SET_PWM, SET_RPM = 0xF0, 0xA8
YDLIDAR_SCAN, YDLIDAR_STOP, YDLIDAR_INFO = 0x60, 0x65, 0x90

INFO_ANSWER, HEALTH_ANSWER, CONF_ANSWER = 0x04, 0x06, 0x20
INFO_LENGTH, HEALTH_LENGTH, CONF_LENGTH = 20, 3, 4

ANSWER_TIMEOUT_S = 0.5

#: Attempts to query identity and health.
ATTEMPTS = 3

#: A scanner that is told to stop finishes its packet; after this time the line is idle.
QUIET_S = 0.03

_SHORTEST = {INFO_ANSWER: INFO_LENGTH, HEALTH_ANSWER: HEALTH_LENGTH, CONF_ANSWER: CONF_LENGTH}
_SYNC = 0xA5
_DESCRIPTOR = b"\xa5\x5a"
_DESCRIPTOR_LENGTH = 7
_LENGTH_BITS = 0x3FFFFFFF
_READ_AHEAD_S = 0.02


class Answer(NamedTuple):
    """A reply: its type, its content, and the bytes that followed it."""

    kind: int
    data: bytes
    rest: bytes


def request(command: int, payload: bytes = b"") -> bytes:
    """Return the bytes of a request; with a payload it carries the length and the XOR of all bytes."""
    head = bytes((_SYNC, command))
    if not payload:
        return head
    body = head + bytes((len(payload),)) + payload
    return body + bytes((reduce(xor, body),))


def ask(
    port: SerialPort, message: bytes, kind: int, timeout_s: float = ANSWER_TIMEOUT_S, *, attempts: int = 1
) -> Answer | None:
    """Send a request and wait for its reply; None if none of that type and length arrives.

    Raises PortDisconnected.
    """
    for _ in range(attempts):
        port.send(message)
        answer = await_answer(port, (kind,), timeout_s)
        if answer is not None and len(answer.data) >= _SHORTEST[kind]:
            return answer
    return None


def await_answer(
    port: SerialPort, kinds: tuple[int, ...], timeout_s: float = ANSWER_TIMEOUT_S, *, many: bool = False
) -> Answer | None:
    """Wait for a reply of one of several types. Earlier bytes are skipped.

    Args:
        many: the reply is a stream; wait only for its descriptor.
    """
    clock = AwakeClock()
    received = b""
    while True:
        start = received.find(_DESCRIPTOR)
        while start >= 0 and len(received) >= start + _DESCRIPTOR_LENGTH:
            length = int.from_bytes(received[start + 2 : start + 6], "little") & _LENGTH_BITS
            content = start + _DESCRIPTOR_LENGTH
            end = content if many else content + length
            if received[start + 6] in kinds:
                if len(received) >= end:
                    return Answer(received[start + 6], received[content:end], received[end:])
                break
            start = received.find(_DESCRIPTOR, start + 1)
        left_s = timeout_s - clock.now_s()
        if left_s <= 0:
            return None
        received += port.receive(_DESCRIPTOR_LENGTH, time.monotonic() + min(left_s, _READ_AHEAD_S))


def quieten(port: SerialPort) -> None:
    """Stop a scan that an earlier program left running, and drop waiting bytes."""
    for command in (STOP, YDLIDAR_STOP):
        port.send(request(command))
    time.sleep(QUIET_S)
    port.discard_input()
