"""Operations of the control channel for an emulated camera."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, ClassVar

from joshua_emulator.camera.frames import FrameSizeError, frame_factory
from joshua_emulator.camera.server import CameraServer
from joshua_emulator.camera.stream_faults import StreamFaults
from joshua_emulator.fault_rules import LASTS, PLAIN, PROBABILITY, RETURNS, FaultRule, Number, Text
from joshua_emulator.operations import Action, DeviceOperations, Request

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


class CameraOperations(DeviceOperations):
    """Operations by name; ``handle`` is the handler of the control channel."""

    refusals: ClassVar[tuple[type[Exception], ...]] = (FrameSizeError, OSError)

    def __init__(self, server: CameraServer) -> None:
        super().__init__(server.log, FAULTS)
        self._server = server
        self._original = (server.width, server.height, server.fps)
        self.operations = {
            "state": self._state,
            "log": self.read_log,
            "lateness": lambda request: server.log.lateness(clear=bool(request.get("clear"))),
            "fault": self.fault,
            "clear_faults": self._clear_faults,
            "quit": lambda _: server.stop(),
        }

    def at(self, delay_s: float, action: Action) -> None:
        """Call ``action`` after a delay, on the loop of the camera."""
        self._server.timers.at(delay_s, action)

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

    def fault_action(self, kind: str, request: Request) -> Action:
        """Return the action that injects a valid fault. Raises FrameSizeError."""
        server = self._server
        if kind in StreamFaults.KINDS:
            value = request["value"]
            return lambda: server.faults.set(kind, value)
        makers: dict[str, Callable[[Request], Action]] = {
            "stall": self._stall,
            "unplug": self._unplug,
            "replug": lambda _: server.plug,
            "dirty": lambda _: lambda: setattr(server, "dirty", True),
            "size": self._size,
            "rate": self._rate,
        }
        return makers[kind](request)

    def _stall(self, request: Request) -> Action:
        """Send no frame for ``value`` seconds or until the faults are cleared; connections stay open."""

        def stall() -> None:
            self._server.stalled = True
            self.log.add("stall", time.monotonic())

        return self.lasting("stall", request, stall, self._go_on)

    def _go_on(self) -> None:
        if self._server.stalled:
            self._server.stalled = False
            self.log.add("go_on", time.monotonic())

    def _unplug(self, request: Request) -> Action:
        server = self._server
        replug_after_s = float(request.get("replug_after_s", 0.0))

        def unplug() -> None:
            server.unplug()
            if replug_after_s > 0:
                self.later(replug_after_s, server.plug)

        return unplug

    def _size(self, request: Request) -> Action:
        width, height = map(int, request["value"].split("x"))
        frame_factory(width, height)
        return lambda: self._server.set_size(width, height)

    def _rate(self, request: Request) -> Action:
        fps = float(request["value"])
        return lambda: self._server.set_rate(fps)

    def _clear_faults(self, _: Request) -> None:
        """Clear all faults: the camera is connected and runs at its initial size and rate."""
        server = self._server
        width, height, fps = self._original
        server.faults.clear()
        server.dirty = False
        self.end_lasting()
        self._go_on()
        server.plug()
        if (server.width, server.height) != (width, height):
            server.set_size(width, height)
        if server.fps != fps:
            server.set_rate(fps)
