"""An emulated hub as one machine: event loop, control channel, motors, firmware, radio."""

from __future__ import annotations

import asyncio
import math
import os
import socket
import time
from collections.abc import Callable, Collection, Coroutine, Mapping, Sequence
from typing import Any

from joshua_emulator.control import ControlServer
from joshua_emulator.event_log import EventLog
from joshua_emulator.motion import Trajectory, calibrating, sine
from joshua_emulator.spike.hub import HubFirmware
from joshua_emulator.spike.motors import EmulatedMotor
from joshua_emulator.spike.radio import Radio

HOST = "127.0.0.1"
#: Initial angles of the shafts in degrees, by port.
FIRST_ANGLES_DEG = (12, -25, 40, -8, 5, -33)
#: How far a hand turns a shaft to both sides of that for a calibration.
REACH_DEG = 100.0


class HubMachine:
    """One hub in one process, with its own event loop.

    Args:
        name: under which the hub advertises; ports: letters of the ports with motors.
    """

    def __init__(self, name: str, ports: Sequence[str]) -> None:
        self.log = EventLog()
        self.motors: Mapping[str, EmulatedMotor] = {port: EmulatedMotor(_first_angle(port)) for port in ports}
        self.hub = HubFirmware(self.motors, self.log)
        self.control: ControlServer | None = None
        listener = socket.create_server((HOST, 0))
        self.port = int(listener.getsockname()[1])
        self._loop = asyncio.new_event_loop()
        self.radio = Radio(name, self.hub, listener, self.log)
        self._loop.run_until_complete(self.radio.start())
        self._stopped = False
        self._tasks: set[asyncio.Task[None]] = set()

    def at(self, delay_s: float, action: Callable[[], object]) -> None:
        """Call ``action`` after a delay, on the loop."""
        self._loop.call_later(delay_s, action)

    def off(self) -> None:
        """Switch the hub off: the program is gone, the link is lost."""
        self.log.add("off", time.monotonic())
        self.hub.close()
        self.soon(self.radio.go(near=False))

    def on(self) -> None:
        """Switch the hub on again, with an empty memory; or bring it back into range."""
        self.log.add("on", time.monotonic())
        self.soon(self.radio.go(near=True))

    def soon(self, coroutine: Coroutine[Any, Any, None]) -> None:
        """Run a coroutine on the loop: at once where it stands still, else beside the rest."""
        if self._loop.is_running():
            task = self._loop.create_task(coroutine)
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
        else:
            self._loop.run_until_complete(coroutine)

    def on_loop(self, action: Callable[[], None]) -> None:
        """Call a function that needs the running loop."""

        async def call() -> None:
            action()

        self.soon(call())

    def start_motion(self, values: Mapping[str, Any]) -> None:
        """Turn the shafts back and forth about their initial angles. Raises MotionError."""
        paths = sine(values, list(self.motors))
        start_s = time.monotonic()
        for index, (port, motor) in enumerate(self.motors.items()):
            motor.hand(_degrees(paths[index], _first_angle(port), start_s))

    def guide(self, joint: int | None, seconds: float) -> None:
        """Move the shafts for a calibration. Raises MotionError."""
        reach = math.radians(REACH_DEG)
        present = [
            math.radians(motor.absolute_deg - _first_angle(port)) for port, motor in self.motors.items()
        ]
        paths = calibrating(joint, present, [(-reach, reach)] * len(present), seconds)
        start_s = time.monotonic()
        for index, (port, motor) in enumerate(self.motors.items()):
            path = paths.get(index)
            motor.hand(None if path is None else _degrees(path, _first_angle(port), start_s))

    def run(self, watched: Collection[int] = ()) -> None:
        """Run until ``stop``, or until one of the ``watched`` file descriptors reaches its end."""
        self._loop.run_until_complete(self._run(watched))

    def stop(self) -> None:
        """End ``run``."""
        self._stopped = True
        self._loop.call_soon_threadsafe(lambda: None)

    def close(self) -> None:
        """Release all resources."""
        self.hub.close()
        self._loop.run_until_complete(self.radio.close())
        if self.control is not None:
            self.control.close()
        self._loop.close()

    async def _run(self, watched: Collection[int]) -> None:
        assert self.control is not None
        ended = asyncio.Event()
        served: set[int] = set()

        def serve(descriptor: int) -> None:
            assert self.control is not None
            self.control.serve((descriptor,))
            follow()

        def follow() -> None:
            """Watch the connections that the control channel has now."""
            assert self.control is not None
            now = set(self.control.descriptors())
            for descriptor in served - now:
                self._loop.remove_reader(descriptor)
            for descriptor in now - served:
                self._loop.add_reader(descriptor, serve, descriptor)
            served.clear()
            served.update(now)
            if self._stopped:
                ended.set()

        def watch(descriptor: int) -> None:
            if not os.read(descriptor, 4096) or self._stopped:
                ended.set()

        for descriptor in watched:
            self._loop.add_reader(descriptor, watch, descriptor)
        follow()
        try:
            await ended.wait()
        finally:
            for descriptor in (*watched, *served):
                self._loop.remove_reader(descriptor)


def _first_angle(port: str) -> float:
    return FIRST_ANGLES_DEG["ABCDEF".index(port)]


def _degrees(path: Trajectory, center_deg: float, start_s: float) -> Callable[[float], float]:
    """Monotonic seconds to degrees against the mark, of a path in radians about a centre."""
    return lambda now_s: center_deg + math.degrees(path(now_s - start_s))
