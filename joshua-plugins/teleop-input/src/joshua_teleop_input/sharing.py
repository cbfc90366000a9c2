"""Share a gamepad of this machine over a UNIX socket."""

from __future__ import annotations

import contextlib
import os
import socket
import time
from dataclasses import replace
from pathlib import Path

from joshua.api import DeviceDisconnected

from joshua_teleop_input.codes import EV_ABS, EV_KEY, EV_SYN, SYN_DROPPED, SYN_REPORT
from joshua_teleop_input.discovery import EventDevice
from joshua_teleop_input.errors import InputDeviceError
from joshua_teleop_input.events import RECORD, Capabilities, InputEvent
from joshua_teleop_input.remote_device import LIFE_SIGN_S, header_line

_MAX_CLIENTS = 8


class GamepadShare:
    """A socket that shares one gamepad.

    Args:
        path: of the socket, accessible only to this user.

    Raises:
        InputDeviceError: the socket cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._clients: list[socket.socket] = []
        self._sent_s = 0.0
        if path.is_socket():
            _refuse_if_served(path)
            path.unlink()
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        former = os.umask(0o177)
        try:
            self._listener.bind(str(path))
        except OSError as error:
            self._listener.close()
            reason = (error.strerror or str(error)).lower()
            raise InputDeviceError(f"{path} cannot be created: {reason}; name another path") from error
        finally:
            os.umask(former)
        self._listener.listen(_MAX_CLIENTS)
        self._listener.setblocking(False)

    @property
    def clients(self) -> int:
        """Number of connected programs."""
        return len(self._clients)

    def serve(self, device: EventDevice, now: Capabilities) -> Capabilities:
        """Run one cycle: forward the device's records; return its present state.

        Raises:
            DeviceDisconnected: the gamepad is gone; all connections were closed.
        """
        try:
            events = device.read(LIFE_SIGN_S / 2)
            for event in events:
                if event.type == EV_SYN and event.code == SYN_DROPPED:
                    self.cut_off()  # a new connection receives the complete state
                    now = device.resynchronise()
                    events = []
                    break
                now = _after(now, event)
        except DeviceDisconnected:
            self.cut_off()
            raise
        if events or time.monotonic() - self._sent_s >= LIFE_SIGN_S / 2:
            self._send(events or [InputEvent(EV_SYN, SYN_REPORT, 0)])
        self._accept(now)
        return now

    def cut_off(self) -> None:
        """Close all connections."""
        for client in self._clients:
            client.close()
        self._clients.clear()

    def close(self) -> None:
        """Close the socket and all connections. Idempotent."""
        self.cut_off()
        if self._listener.fileno() >= 0:
            self._listener.close()
            with contextlib.suppress(OSError):  # a file system that has become read-only
                self.path.unlink(missing_ok=True)

    def _accept(self, now: Capabilities) -> None:
        with contextlib.suppress(BlockingIOError):
            client, _ = self._listener.accept()
            client.setblocking(False)
            if len(self._clients) >= _MAX_CLIENTS:
                client.close()
                return
            self._clients.append(client)
            self._send_to(client, header_line(now))

    def _send(self, events: list[InputEvent]) -> None:
        self._sent_s = time.monotonic()
        seconds, nanoseconds = divmod(time.time_ns(), 1_000_000_000)
        data = b"".join(
            RECORD.pack(seconds, nanoseconds // 1000, event.type, event.code, event.value) for event in events
        )
        for client in list(self._clients):
            self._send_to(client, data)

    def _send_to(self, client: socket.socket, data: bytes) -> None:
        try:
            whole = client.send(data) == len(data)
        except OSError:
            whole = False
        if not whole:  # gone, or too slow to receive current data
            client.close()
            self._clients.remove(client)


def _after(now: Capabilities, event: InputEvent) -> Capabilities:
    if event.type == EV_KEY:
        return replace(now, held=now.held | {event.code} if event.value else now.held - {event.code})
    if event.type == EV_ABS and event.code in now.axes:
        return replace(now, axes={**now.axes, event.code: replace(now.axes[event.code], value=event.value)})
    return now


def _refuse_if_served(path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe, contextlib.suppress(OSError):
        probe.connect(str(path))
        raise InputDeviceError(f"{path} is in use: another program shares a gamepad there; name another path")
