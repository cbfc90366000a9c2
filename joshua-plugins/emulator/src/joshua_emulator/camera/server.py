"""The event loop of an emulated camera: frames on time, clients, and the control channel."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import time
from collections.abc import Collection

from joshua_emulator.camera.connection import Connection
from joshua_emulator.camera.frame_code import FrameCode
from joshua_emulator.camera.frames import frame_factory
from joshua_emulator.camera.simulated_view import SimulatedView, dark_picture
from joshua_emulator.camera.stream_faults import StreamFaults
from joshua_emulator.control import ControlServer
from joshua_emulator.event_log import EventLog
from joshua_emulator.pacing import sharpen_timers
from joshua_emulator.timers import Timers, wait_s

HOST = "127.0.0.1"
MAX_CLIENTS = 32
_READ_SIZE = 4096


class CameraServer:
    """A camera that runs with or without clients: frame k is sent at start + k / rate.

    A client that has not received a frame when the next one is due misses the next one. Pictures of a
    simulation are requested at the time of their frame and sent as soon as they are rendered.

    Args:
        width, height: of the pictures, in pixels; fps: frames per second.
        port: of the loopback interface; 0 takes a free one.
        view: source of the pictures; None means the test scene with the frame code.
    """

    def __init__(
        self,
        width: int,
        height: int,
        fps: float,
        log: EventLog,
        faults: StreamFaults,
        *,
        port: int = 0,
        view: SimulatedView | None = None,
    ) -> None:
        self.width, self.height, self.fps = width, height, fps
        self.log, self.faults = log, faults
        self.control: ControlServer | None = None
        self.view = view
        self.number = 0
        self._asked = FrameCode(0, 0)
        self._late = False  # a frame was due while the previous one was still being rendered
        self.stalled = False
        self.dirty = False  # each stream begins with the second half of a picture
        self._listener: socket.socket | None = None
        self._clients: list[Connection] = []
        self.timers = Timers()
        self._stopped = False
        self._due_s = 0.0
        frame_factory(width, height)
        self.port = port
        self.plug()

    @property
    def plugged(self) -> bool:
        """Whether the camera is connected."""
        return self._listener is not None

    @property
    def streams(self) -> int:
        """Number of clients that read the stream."""
        return sum(client.streaming for client in self._clients)

    def plug(self) -> None:
        """Let clients connect, always at the same port."""
        if self._listener is not None:
            return
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((HOST, self.port))
            listener.listen(MAX_CLIENTS)
        except OSError:
            listener.close()
            raise
        listener.setblocking(False)
        self.port = listener.getsockname()[1]
        self._listener = listener
        self.log.add("plug", time.monotonic(), port=self.port)

    def unplug(self) -> None:
        """Disconnect all clients in the middle of a transfer and refuse new ones."""
        if self._listener is not None:
            self._listener.close()
            self._listener = None
        for client in self._clients:
            client.close()
        self._clients.clear()
        self.log.add("unplug", time.monotonic())

    def set_size(self, width: int, height: int) -> None:
        """Serve pictures of another size from the next frame on. Raises FrameSizeError."""
        frame_factory(width, height)
        self.width, self.height = width, height
        self._due_s = time.monotonic()  # preparing the pictures took the time of several frames

    def set_rate(self, fps: float) -> None:
        """Serve another number of frames per second from the next frame on."""
        self.fps = fps
        self._due_s = time.monotonic() + 1 / fps

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
                self._frame(now_s)
            ready = self._wait(watched)
            if any(not os.read(descriptor, _READ_SIZE) for descriptor in watched if descriptor in ready):
                return
            if self.control is not None:
                self.control.serve(ready)

    def close(self) -> None:
        """Disconnect the clients and close the control channel."""
        self.unplug()
        if self.view is not None:
            self.view.close()
        if self.control is not None:
            self.control.close()

    def _wait(self, watched: Collection[int]) -> set[int]:
        """Wait for the next due time and serve clients. Return the other descriptors that are ready."""
        self._clients = [client for client in self._clients if not client.closed]
        deadline_s = min(self._due_s, self.timers.next_s)
        others = [*watched, *(self.control.descriptors() if self.control is not None else ())]
        if self.view is not None:
            others += self.view.descriptors()
        clients = {client.fileno(): client for client in self._clients}
        if self._listener is not None:
            others.append(self._listener.fileno())
        readable, writable, _ = select.select(
            [*others, *clients],
            [descriptor for descriptor, client in clients.items() if client.sending],
            [],
            wait_s(deadline_s),
        )
        for descriptor in writable:
            clients[descriptor].flush()
        for descriptor in readable:
            if descriptor in clients and not clients[descriptor].closed:
                clients[descriptor].receive()
        if self._listener is not None and self._listener.fileno() in readable:
            self._accept()
        if self.view is None:
            self._serve_pictures()
        elif (picture := self.view.receive()) is not None and not self.stalled:
            self._deliver(self._asked, picture)
            if self._late:
                self._ask(self._asked.number + 1)
        return set(readable)

    def _accept(self) -> None:
        assert self._listener is not None
        with contextlib.suppress(OSError):  # it may have gone again
            peer, _ = self._listener.accept()
            if len(self._clients) >= MAX_CLIENTS:
                peer.close()
                return
            self._clients.append(Connection(peer))

    def _serve_pictures(self) -> None:
        for client in self._clients:
            if client.wants_picture and not self.stalled:
                code = FrameCode(self.number, time.monotonic_ns())
                client.send_picture(frame_factory(self.width, self.height).frame(code))

    def _frame(self, now_s: float) -> None:
        """Send the due frame to all clients of the stream."""
        self.log.delivered(now_s - self._due_s)
        self._due_s += 1 / self.fps
        if now_s - self._due_s > 1 / self.fps:  # this process was stalled: skip those frames
            self._due_s = now_s + 1 / self.fps
        number, self.number = self.number, self.number + 1
        if self.stalled or self.faults.drops():
            return
        if not any(client.streaming or client.wants_picture for client in self._clients):
            return
        code = FrameCode(number, time.monotonic_ns())
        if self.view is None:
            self._deliver(code, frame_factory(self.width, self.height).frame(code))
        elif self.view.answered:
            self._ask(number)
        else:
            self.view.ask(self.width, self.height)  # looks for the simulation
            self._deliver(code, dark_picture(self.width, self.height))

    def _ask(self, number: int) -> None:
        """Request a frame from the simulation as soon as the previous one is rendered."""
        assert self.view is not None
        self._late = not self.view.ask(self.width, self.height)
        if not self._late:
            self._asked = FrameCode(number, time.monotonic_ns())

    def _deliver(self, code: FrameCode, picture: bytes) -> None:
        frame = self.faults.disturb(picture)
        for client in self._clients:
            if client.wants_picture:
                client.send_picture(picture)
            elif client.streaming and client.sending:
                self.log.add("skipped", time.monotonic(), number=code.number)
            elif client.streaming:
                part = frame if client.begun or not self.dirty else frame[len(frame) // 2 :]
                client.send_frame(part, code.number, lambda at_s: self._sent(code, len(frame), at_s))

    def _sent(self, code: FrameCode, size: int, at_s: float) -> None:
        self.log.add("frame", at_s, number=code.number, start_ns=code.sent_ns, bytes=size)
