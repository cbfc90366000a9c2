"""The event loop of an emulated gamepad: input records and the control channel."""

from __future__ import annotations

import contextlib
import json
import os
import select
import socket
import struct
import time
from collections.abc import Callable, Collection, Iterable
from pathlib import Path

from joshua_emulator.control import ControlServer, listen_at
from joshua_emulator.event_log import EventLog
from joshua_emulator.gamepad.xbox import AXES, BUTTONS, EV_ABS, EV_KEY, EV_SYN, IDENTITY, NAME, axis_counts
from joshua_emulator.pacing import sharpen_timers
from joshua_emulator.timers import Timers, wait_s

#: ``struct input_event`` of 64-bit Linux: seconds, microseconds, type, code, value.
RECORD = struct.Struct("<qqHHi")

FORMAT = "joshua-gamepad"
VERSION = 1

MAX_CLIENTS = 8
_SEND_BUFFER = 65_536


class GamepadServer:
    """A gamepad that reports changes at a fixed rate, and a heartbeat without changes.

    Args:
        path: of the socket; rate_hz: of the reports; name: as the device calls itself.
    """

    def __init__(self, path: Path, rate_hz: float, log: EventLog, *, name: str = NAME) -> None:
        self.path, self.rate_hz, self.log, self.name = path, rate_hz, log, name
        self.control: ControlServer | None = None
        self.stalled = False
        self.reports = 0
        self.axes = dict.fromkeys(AXES, 0.0)
        self.held: set[str] = set()
        self.motion: Callable[[float], dict[str, float]] | None = None
        self._reported = self._snapshot()
        self._listener: socket.socket | None = None
        self._clients: list[socket.socket] = []
        self.timers = Timers()
        self._stopped = False
        self._due_s = 0.0
        self._began_s = time.monotonic()
        self.plug()

    @property
    def plugged(self) -> bool:
        """Whether the gamepad is connected."""
        return self._listener is not None

    @property
    def clients(self) -> int:
        """Number of programs that read it."""
        return len(self._clients)

    @property
    def reported(self) -> bool:
        """Whether its last report, and what a new client is told, says everything as it stands."""
        return self._snapshot() == self._reported

    def press(self, name: str, *, down: bool) -> None:
        """Press or release a button."""
        (self.held.add if down else self.held.discard)(name)

    def plug(self) -> None:
        """Let programs connect, always at the same path."""
        if self._listener is not None:
            return
        self._listener = listen_at(self.path)
        self.log.add("plug", time.monotonic(), path=str(self.path))

    def unplug(self) -> None:
        """Disconnect all programs in the middle of a record and remove the path."""
        if self._listener is not None:
            self._listener.close()
            self._listener = None
        self.path.unlink(missing_ok=True)
        for client in self._clients:
            with contextlib.suppress(OSError):
                client.send(RECORD.pack(0, 0, EV_ABS, 0, 0)[: RECORD.size // 2])
            client.close()
        self._clients.clear()
        self.log.add("unplug", time.monotonic())

    def drop_records(self) -> None:
        """Report lost records, like the kernel does to a slow reader."""
        self._send([(EV_SYN, 3, 0), (EV_SYN, 0, 0)])
        self.log.add("dropped", time.monotonic())

    def set_rate(self, rate_hz: float) -> None:
        """Change the report rate."""
        self.rate_hz = rate_hz
        self._due_s = time.monotonic() + 1 / rate_hz

    def stop(self) -> None:
        """End ``run`` after the present cycle."""
        self._stopped = True

    def run(self, watched: Collection[int] = ()) -> None:
        """Run until ``stop``, or until one of the ``watched`` file descriptors reaches its end."""
        sharpen_timers()
        self._due_s = time.monotonic()
        while not self._stopped:
            now_s = time.monotonic()
            self.timers.run_due(now_s)
            if now_s >= self._due_s:
                self._report(now_s)
            deadline_s = min(self._due_s, self.timers.next_s)
            inputs = [*watched, *(self.control.descriptors() if self.control is not None else ())]
            inputs += [item.fileno() for item in (self._listener, *self._clients) if item is not None]
            ready, _, _ = select.select(inputs, [], [], wait_s(deadline_s))
            if any(not os.read(descriptor, 4096) for descriptor in watched if descriptor in ready):
                return
            if self._listener is not None and self._listener.fileno() in ready:
                self._accept()
            self._drop_closed(ready)
            if self.control is not None:
                self.control.serve(ready)

    def close(self) -> None:
        """Disconnect all programs and close the control channel."""
        self.unplug()
        if self.control is not None:
            self.control.close()

    def _snapshot(self) -> dict[tuple[int, int], int]:
        """Return the raw values of the device, by type and code."""
        axes = {(EV_ABS, AXES[name][0]): axis_counts(name, value) for name, value in self.axes.items()}
        return axes | {(EV_KEY, code): int(name in self.held) for name, code in BUTTONS.items()}

    def _report(self, now_s: float) -> None:
        self._due_s += 1 / self.rate_hz
        if now_s > self._due_s:  # this process was stalled: skip those reports
            self._due_s = now_s + 1 / self.rate_hz
        if self.stalled:
            return
        if self.motion is not None:
            for name, value in self.motion(now_s - self._began_s).items():
                if name in BUTTONS:
                    self.press(name, down=value > 0)
                else:
                    self.axes[name] = value
        snapshot = self._snapshot()
        changes = [(*key, value) for key, value in snapshot.items() if value != self._reported[key]]
        self._reported = snapshot
        sent_s = time.monotonic()
        self._send([*changes, (EV_SYN, 0, 0)])
        if changes:
            self.reports += 1
            self.log.add("report", sent_s, changes=[[code, value] for _, code, value in changes])

    def _send(self, records: Iterable[tuple[int, int, int]]) -> None:
        seconds, nanoseconds = divmod(time.time_ns(), 1_000_000_000)
        data = b"".join(RECORD.pack(seconds, nanoseconds // 1000, *record) for record in records)
        for client in list(self._clients):
            try:
                whole = client.send(data) == len(data)
            except OSError:
                whole = False
            if not whole:  # it does not read, or has gone
                client.close()
                self._clients.remove(client)

    def _accept(self) -> None:
        assert self._listener is not None
        with contextlib.suppress(OSError):  # it may have gone again
            client, _ = self._listener.accept()
            client.setblocking(False)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
            if len(self._clients) >= MAX_CLIENTS:
                client.close()
                return
            with contextlib.suppress(OSError):
                client.send(self._header())
            self._clients.append(client)
            self._began_s = time.monotonic()  # a new client sees a motion from its start
            self.log.add("connect", time.monotonic())

    def _header(self) -> bytes:
        """What the queries of a local program would answer, everything as it stands now."""
        counts = self._reported
        axes = {
            str(code): [counts[EV_ABS, code], low, high, fuzz, flat, 0]
            for code, low, high, fuzz, flat in AXES.values()
        }
        facts = {
            "format": FORMAT,
            "version": VERSION,
            "name": self.name,
            "id": list(IDENTITY),
            "keys": sorted(BUTTONS.values()),
            "held": sorted(code for code in BUTTONS.values() if counts[EV_KEY, code]),
            "axes": axes,
        }
        return json.dumps(facts).encode() + b"\n"

    def _drop_closed(self, ready: Collection[int]) -> None:
        for client in [item for item in self._clients if item.fileno() in ready]:
            try:
                gone = not client.recv(4096)
            except BlockingIOError:
                gone = False
            except OSError:
                gone = True
            if gone:
                client.close()
                self._clients.remove(client)
