"""Requests of a host to a scanner, parsed from bytes, and the replies."""

from __future__ import annotations

import struct
from functools import reduce
from operator import xor
from typing import NamedTuple

from joshua_emulator.lidar.models import ScannerModel
from joshua_emulator.lidar.packets import rplidar_descriptor

SYNC = 0xA5
HAS_PAYLOAD = 0x80

STOP, RESET, SCAN, FORCE_SCAN, EXPRESS_SCAN = 0x25, 0x40, 0x20, 0x21, 0x82
GET_INFO, GET_HEALTH, GET_SAMPLERATE, GET_CONF, GET_BOARD = 0x50, 0x52, 0x59, 0x84, 0xFF
SET_PWM, SET_RPM = 0xF0, 0xA8

YD_SCAN, YD_STOP, YD_INFO, YD_HEALTH, YD_RESET = 0x60, 0x65, 0x90, 0x91, 0x80

STANDARD_ANSWER, LEGACY_ANSWER, DENSE_ANSWER = 0x81, 0x82, 0x85
_INFO_ANSWER, _HEALTH_ANSWER, _RATE_ANSWER, _CONF_ANSWER = 0x04, 0x06, 0x15, 0x20

SERIAL_NUMBER = bytes.fromhex("4a4f53485541454d554c415445443031")


class Request(NamedTuple):
    """A request: its command byte and its payload."""

    command: int
    payload: bytes


class RequestReader:
    """Takes requests out of the host's bytes; what is none is left out."""

    def __init__(self, *, payloads: bool) -> None:
        self._payloads = payloads
        self._buffer = b""

    def clear(self) -> None:
        """Discard a partial request."""
        self._buffer = b""

    def take(self, data: bytes) -> list[Request]:
        """Add bytes; return the requests that they complete."""
        buffer = self._buffer + data
        requests = []
        while True:
            start = buffer.find(SYNC)
            if start < 0:
                buffer = b""
                break
            buffer = buffer[start:]
            if len(buffer) < 2:
                break
            command = buffer[1]
            if not (self._payloads and command & HAS_PAYLOAD) or command == GET_BOARD:
                requests.append(Request(command, b""))
                buffer = buffer[2:]
                continue
            if len(buffer) < 3 or len(buffer) < 4 + buffer[2]:
                break
            end = 4 + buffer[2]
            if reduce(xor, buffer[:end]) == 0:
                requests.append(Request(command, buffer[3 : end - 1]))
                buffer = buffer[end:]
            else:
                buffer = buffer[1:]
        self._buffer = buffer
        return requests


def rplidar_info(model: ScannerModel) -> bytes:
    """Model, firmware 1.29, hardware 7 and serial number, as RPLIDARs and YDLIDARs send them."""
    return rplidar_descriptor(20, _INFO_ANSWER) + bytes((model.number, 29, 1, 7)) + SERIAL_NUMBER


def rplidar_health(status: int) -> bytes:
    """Health: 0 good, 1 warning, 2 error with the code 0x8001."""
    code = 0x8001 if status else 0
    return rplidar_descriptor(3, _HEALTH_ANSWER) + struct.pack("<BH", status, code)


def rplidar_samplerate(model: ScannerModel) -> bytes:
    """Microseconds of one measurement in both kinds of scan."""
    values = (round(1e6 / model.sample_hz), round(1e6 / model.express_hz))
    return rplidar_descriptor(4, _RATE_ANSWER) + struct.pack("<HH", *values)


def express_answer(model: ScannerModel) -> int:
    """Type of the capsules that a model sends."""
    return DENSE_ANSWER if model.name == "rplidar_c1" else LEGACY_ANSWER


def rplidar_conf(model: ScannerModel, payload: bytes) -> bytes:
    """One entry of the configuration: modes 0 (standard) and 1 (express)."""
    entry = int.from_bytes(payload[:4], "little")
    mode = int.from_bytes(payload[4:6], "little")
    rate = model.express_hz if mode else model.sample_hz
    values = {
        0x70: struct.pack("<H", 2),
        0x71: struct.pack("<I", round(1e6 / rate * 256)),
        0x74: struct.pack("<I", 12 << 8),
        0x75: bytes((express_answer(model) if mode else STANDARD_ANSWER,)),
        0x7C: struct.pack("<H", 1),
        0x7F: b"Express\x00" if mode else b"Standard\x00",
    }
    data = payload[:4] + values.get(entry, b"")
    return rplidar_descriptor(len(data), _CONF_ANSWER) + data


def rplidar_board() -> bytes:
    """The board takes speeds for the motor."""
    return rplidar_descriptor(4, GET_BOARD) + struct.pack("<I", 1)
