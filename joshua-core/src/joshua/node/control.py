"""The child's end of the control socket: a thread that never lets the nodes wait for the supervisor."""

from __future__ import annotations

import os
import selectors
import socket
import threading
from collections.abc import Callable

from joshua.ipc.frames import EndOfStreamError, FrameError, FrameSocket
from joshua.ipc.messages import Message, ToChild, decode_for_child, encode

#: Unsent bytes beyond which messages that can be missed (heartbeats, logs, rates) are dropped.
BACKLOG_LIMIT_BYTES = 256 * 1024


class ControlChannel:
    """Sends messages to the supervisor from any thread, and receives on a thread of its own.

    Args:
        sock: the inherited control socket.
        on_message: called on the control thread with each message of the supervisor.
        on_orphaned: called once when the supervisor is gone.
        on_signals: called with signal numbers, one byte each.
    """

    def __init__(
        self,
        sock: socket.socket,
        on_message: Callable[[ToChild], None],
        on_orphaned: Callable[[], None],
        on_signals: Callable[[bytes], None],
    ) -> None:
        self._on_message, self._on_orphaned, self._on_signals = on_message, on_orphaned, on_signals
        self._frames = FrameSocket(sock)
        self._lock = threading.Lock()
        self._wake_receiver, self._wake_sender = socket.socketpair()
        self._wake_receiver.setblocking(False)
        self._wake_sender.setblocking(False)
        self._dropped = 0
        self._ended = False

    @property
    def wake_descriptor(self) -> int:
        """Descriptor for ``signal.set_wakeup_fd``: a byte written to it reaches ``on_signals``."""
        return self._wake_sender.fileno()

    @property
    def dropped(self) -> int:
        """Messages dropped because the supervisor did not read."""
        return self._dropped

    def start(self) -> None:
        """Starts the control thread."""
        threading.Thread(target=self._run, name="control", daemon=True).start()

    def send(self, message: Message, *, can_miss: bool = False) -> None:
        """Sends a message or queues it; never blocks and never raises.

        Args:
            can_miss: drop the message when the supervisor has not read for long.
        """
        payload = encode(message)
        with self._lock:
            if self._ended or (can_miss and self._frames.pending_bytes > BACKLOG_LIMIT_BYTES):
                self._dropped += 1
                return
            try:
                all_sent = self._frames.send(payload)
            except EndOfStreamError:
                self._ended = True  # the control thread sees it too and stops the nodes
                return
        if not all_sent:
            self._wake()

    def drain(self, timeout_s: float) -> bool:
        """Waits until everything has left, at the end of the process; returns whether it has."""
        selector = selectors.DefaultSelector()
        selector.register(self._frames.fileno(), selectors.EVENT_WRITE)
        with selector:
            for _ in range(100):
                with self._lock:
                    try:
                        if self._ended or self._frames.flush():
                            return not self._ended
                    except EndOfStreamError:
                        return False
                selector.select(timeout_s / 100)
        return False

    def _wake(self) -> None:
        try:
            self._wake_sender.send(b"\0")
        except OSError:
            return  # full: the thread is awake anyway

    def _run(self) -> None:
        selector = selectors.DefaultSelector()
        selector.register(self._frames.fileno(), selectors.EVENT_READ, "control")
        selector.register(self._wake_receiver.fileno(), selectors.EVENT_READ, "wake")
        connected = True
        while True:
            for key, events in selector.select():
                if key.data == "wake":
                    numbers = self._read_wake().replace(b"\0", b"")
                    if numbers:
                        self._on_signals(numbers)
                elif connected and not self._serve(events):
                    connected = False
                    selector.unregister(self._frames.fileno())
            if connected:
                with self._lock:
                    waiting = self._frames.pending_bytes > 0
                wanted = selectors.EVENT_READ | (selectors.EVENT_WRITE if waiting else 0)
                selector.modify(self._frames.fileno(), wanted, "control")

    def _serve(self, events: int) -> bool:
        """Reads and writes once; returns whether the supervisor is still there."""
        try:
            with self._lock:
                payloads = self._frames.receive() if events & selectors.EVENT_READ else []
                self._frames.flush()
            for payload in payloads:
                self._on_message(decode_for_child(payload))
        except (EndOfStreamError, FrameError):
            with self._lock:
                self._ended = True
            self._on_orphaned()
            return False
        return True

    def _read_wake(self) -> bytes:
        try:
            return self._wake_receiver.recv(4096)
        except BlockingIOError:
            return b""


def control_socket(descriptor: int) -> socket.socket:
    """Takes over an inherited descriptor as the control socket and keeps it from programs started here."""
    os.set_inheritable(descriptor, False)
    return socket.socket(fileno=descriptor)
