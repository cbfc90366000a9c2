"""A gamepad behind a UNIX socket: attached to another machine, or emulated.

The stream begins with one line of JSON that describes the device like the kernel's answers to a local
program; the kernel's own records, ``<qqHHi``, follow. The sender sends a heartbeat, an empty report, at least
every 100 ms.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import socket
from typing import Any

from joshua.api import DeviceDisconnected
from joshua.api.clocks import AwakeClock
from joshua.tools import parse_json

from joshua_teleop_input.errors import InputDeviceError
from joshua_teleop_input.events import AxisRange, Capabilities, EventDecoder, InputEvent

FORMAT = "joshua-gamepad"
VERSION = 1

#: Interval of the sender's heartbeats.
LIFE_SIGN_S = 0.1

#: Time without data after which all controls count as released.
SILENCE_LIMIT_S = 0.3

#: Time without data after which the connection counts as lost; stalls of this process do not count.
LOST_AFTER_S = 2.0

_CONNECT_TIMEOUT_S = 2.0
_LOOK_S = 0.1
_MAX_HEADER = 65_536
_MAX_CODE = 0x2FF
_MAX_INT = 2**31


class RemoteDevice:
    """A connection to a sender.

    Args:
        path: of the socket.

    Raises:
        InputDeviceError: no process listens there, or the data are not a gamepad's.
    """

    silence_limit_s: float | None = SILENCE_LIMIT_S

    def __init__(self, path: str) -> None:
        self.path = path
        self._decoder = EventDecoder()
        self._events: list[InputEvent] = []
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.settimeout(_CONNECT_TIMEOUT_S)
            self._connect()
            self.capabilities = self._read_header()
            self._socket.setblocking(False)
        except BaseException:
            self.close()
            raise
        self._awake = AwakeClock()
        self._heard_s = self._awake.now_s()

    def grab(self) -> None:
        """Do nothing: the sender holds the device."""

    def read(self, timeout_s: float) -> list[InputEvent]:
        """Wait for records. Raises DeviceDisconnected."""
        if self._events:
            events, self._events = self._events, []
            return events
        ready, _, _ = select.select([self._socket], [], [], timeout_s)
        if not ready:
            if self._awake.now_s() - self._heard_s > LOST_AFTER_S:
                raise DeviceDisconnected(f"{self.path}: no data from the sender")
            return []
        try:
            data = self._socket.recv(4096)
        except BlockingIOError:
            return []
        except OSError as error:
            raise DeviceDisconnected(f"{self.path}: {os.strerror(error.errno or 0).lower()}") from error
        if not data:
            raise DeviceDisconnected(f"{self.path}: the sender has closed the connection")
        self._heard_s = self._awake.now_s()
        return self._decoder.feed(data)

    def resynchronise(self) -> Capabilities:
        """Raise DeviceDisconnected: a new client receives the present state."""
        raise DeviceDisconnected(f"{self.path}: the sender has lost records")

    def close(self) -> None:
        """End the connection. Idempotent."""
        with contextlib.suppress(OSError):
            self._socket.close()

    def _connect(self) -> None:
        try:
            self._socket.connect(self.path)
        except PermissionError:
            raise InputDeviceError(
                f"{self.path} may not be opened by this user: let the same user share it"
            ) from None
        except OSError as error:
            raise InputDeviceError(
                f"no gamepad is shared at {self.path} ({(error.strerror or str(error)).lower()}): "
                "start joshua share-gamepad on the other machine"
            ) from error

    def _read_header(self) -> Capabilities:
        data = b""
        clock = AwakeClock()
        self._socket.settimeout(_LOOK_S)
        while b"\n" not in data and len(data) <= _MAX_HEADER:
            late = clock.now_s() > _CONNECT_TIMEOUT_S
            try:
                piece = self._socket.recv(4096)
            except TimeoutError:
                if not late:
                    continue
                piece = b""
            except OSError as error:
                raise InputDeviceError(
                    f"{self.path}: the sender disconnected during the connection ({error})"
                ) from error
            if not piece or late:
                raise InputDeviceError(f"{self.path}: the sender does not describe its gamepad")
            data += piece
        line, _, rest = data.partition(b"\n")
        self._events = self._decoder.feed(rest)
        return parse_header(line, self.path)


def parse_header(line: bytes, path: str) -> Capabilities:
    """Read the first line of a stream. Raises InputDeviceError."""
    try:
        values: Any = parse_json(line)
        if values["format"] != FORMAT:
            raise ValueError(f"format {values['format']!r}")
        if values["version"] != VERSION:
            raise InputDeviceError(
                f"{path}: the sender uses version {values['version']} of the format, but this machine uses "
                f"{VERSION}: install the same joshua-teleop-input on both machines"
            )
        return Capabilities(
            str(values["name"])[:200],
            tuple(_integer(number, 0xFFFF) for number in values["id"]),
            keys=frozenset(_integer(code, _MAX_CODE) for code in values["keys"]),
            held=frozenset(_integer(code, _MAX_CODE) for code in values["held"]),
            axes={
                _integer(int(code), 0x3F): AxisRange(*(_integer(number, _MAX_INT) for number in facts))
                for code, facts in values["axes"].items()
            },
        )
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputDeviceError(
            f"{path} is not a shared gamepad: its data begin with {line[:40]!r}; run joshua share-gamepad "
            "on the other machine"
        ) from error


def header_line(capabilities: Capabilities) -> bytes:
    """The first line of a stream."""
    facts = capabilities
    values = {
        "format": FORMAT,
        "version": VERSION,
        "name": facts.name,
        "id": list(facts.identity),
        "keys": sorted(facts.keys),
        "held": sorted(facts.held),
        "axes": {
            str(code): [axis.value, axis.minimum, axis.maximum, axis.fuzz, axis.flat, axis.resolution]
            for code, axis in sorted(facts.axes.items())
        },
    }
    return json.dumps(values).encode() + b"\n"


def _integer(value: Any, largest: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not -largest <= value <= largest:
        raise ValueError(f"{value!r} is no number up to {largest}")
    return value
