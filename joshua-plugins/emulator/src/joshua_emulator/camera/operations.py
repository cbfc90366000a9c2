"""What the control channel can ask of an emulated camera."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from joshua_emulator.camera.frames import FrameSizeError, frame_factory
from joshua_emulator.camera.server import CameraServer
from joshua_emulator.camera.stream_faults import StreamFaults
from joshua_emulator.control import ControlError
from joshua_emulator.fault_rules import (
    LASTS,
    PLAIN,
    PROBABILITY,
    RETURNS,
    FaultRule,
    Number,
    Text,
    check_fault,
)

Request = dict[str, Any]

MAX_FPS = 1000.0
FAULTS: dict[str, FaultRule] = {
    **dict.fromkeys(StreamFaults.KINDS, PROBABILITY),
    "stall": LASTS,
    "unplug": RETURNS,
    "replug": PLAIN,
    "dirty": PLAIN,
    "size": FaultRule(Text("WIDTHxHEIGHT, such as 800x600", "[0-9]{1,5}x[0-9]{1,5}")),
    "rate": FaultRule(Number(f"above 0, at most {MAX_FPS:g} Hz", 0, MAX_FPS, above=True)),
}


class CameraOperations:
    """Operations by name; ``handle`` is the control channel's handler."""

    def __init__(self, server: CameraServer) -> None:
        self._server = server
        self._original = (server.width, server.height, server.fps)
        self._stalls = 0
        self._operations: dict[str, Callable[[Request], dict[str, Any] | None]] = {
            "state": self._state,
            "log": self._read_log,
            "lateness": lambda request: server.log.lateness(clear=bool(request.get("clear"))),
            "fault": self._fault,
            "clear_faults": self._clear_faults,
            "quit": lambda _: server.stop(),
        }

    def handle(self, request: Request) -> dict[str, Any]:
        """Carries out one request. Raises ControlError."""
        operation = self._operations.get(request["op"])
        if operation is None:
            raise ControlError(f"unknown operation {request['op']!r}; allowed: {', '.join(self._operations)}")
        try:
            return operation(request) or {}
        except KeyError as error:
            raise ControlError(f"{request['op']}: {error.args[0]!r} is missing") from error
        except FrameSizeError as error:
            raise ControlError(f"{request['op']}: {error}") from error
        except (TypeError, ValueError) as error:
            raise ControlError(f"{request['op']}: a value is wrong ({error})") from error

    def _state(self, _: Request) -> dict[str, Any]:
        server = self._server
        return {
            "t_ns": time.monotonic_ns(),
            "plugged": server.plugged,
            "stalled": server.stalled,
            "port": server.port,
            "width": server.width,
            "height": server.height,
            "fps": server.fps,
            "number": server.number,
            "streams": server.streams,
            "faults": server.faults.describe(),
            "fault_counts": dict(server.faults.counts),
        }

    def _read_log(self, request: Request) -> dict[str, Any]:
        entries = self._server.log.since(
            int(request.get("since", 0)), request.get("events", ()), int(request.get("limit", 10_000))
        )
        return {"entries": entries}

    def _fault(self, request: Request) -> None:
        """Brings a fault about: ``kind``, its ``value`` and settings, ``at_s`` seconds from now on."""
        check_fault(request, FAULTS)
        action = self._fault_action(request["kind"], request)
        delay_s = float(request.get("at_s", 0.0))
        if delay_s > 0:
            self._server.at(delay_s, action)
        else:
            action()

    def _fault_action(self, kind: str, request: Request) -> Callable[[], None]:
        server = self._server
        if kind in StreamFaults.KINDS:
            value = request["value"]
            return lambda: server.faults.set(kind, value)
        makers: dict[str, Callable[[Request], Callable[[], None]]] = {
            "stall": self._stall,
            "unplug": self._unplug,
            "replug": lambda _: server.plug,
            "dirty": lambda _: lambda: setattr(server, "dirty", True),
            "size": self._size,
            "rate": self._rate,
        }
        return makers[kind](request)

    def _stall(self, request: Request) -> Callable[[], None]:
        """No frame for ``value`` seconds, or until the faults are cleared; connections stay open."""
        length_s = float(request.get("value", 0.0))

        def stall() -> None:
            server = self._server
            server.stalled = True
            self._stalls += 1
            mine = self._stalls
            server.log.add("stall", time.monotonic())
            if length_s > 0:
                server.at(length_s, lambda: self._go_on(mine))

        return stall

    def _go_on(self, stall: int) -> None:
        if self._server.stalled and stall == self._stalls:
            self._server.stalled = False
            self._server.log.add("go_on", time.monotonic())

    def _unplug(self, request: Request) -> Callable[[], None]:
        server = self._server
        replug_after_s = float(request.get("replug_after_s", 0.0))

        def unplug() -> None:
            server.unplug()
            if replug_after_s > 0:
                server.at(replug_after_s, server.plug)

        return unplug

    def _size(self, request: Request) -> Callable[[], None]:
        width, height = map(int, request["value"].split("x"))
        frame_factory(width, height)
        return lambda: self._server.set_size(width, height)

    def _rate(self, request: Request) -> Callable[[], None]:
        fps = float(request["value"])
        return lambda: self._server.set_rate(fps)

    def _clear_faults(self, _: Request) -> None:
        """Ends all faults: the camera is plugged in, goes on, and has its first size and rate."""
        server = self._server
        width, height, fps = self._original
        server.faults.clear()
        server.dirty = False
        self._go_on(self._stalls)
        server.plug()
        if (server.width, server.height) != (width, height):
            server.set_size(width, height)
        if server.fps != fps:
            server.set_rate(fps)
