"""The child's end of the control socket: a thread, so that nodes never wait for the supervisor."""

from __future__ import annotations

import contextlib
import os
import selectors
import socket
import threading
from collections.abc import Callable

from joshua.ipc.frames import EndOfStreamError, FrameError, FrameSocket
from joshua.ipc.messages import Message, ToChild, decode_for_child, encode

#: Unsent bytes beyond which unessential messages (heartbeats, logs, rates) are dropped.
BACKLOG_LIMIT_BYTES = 256 * 1024


class ControlChannel:
    """Sends messages to the supervisor from any thread, and receives on a separate thread.

    Args:
        descriptor: of the inherited control socket; programs started here do not inherit it.
        on_message: receives a message of the supervisor, on the control thread like all callbacks.
        on_orphaned: called once, when the supervisor is gone.
        on_signals: receives signals, one byte each.
    """

    def __init__(
        self,
        descriptor: int,
        on_message: Callable[[ToChild], None],
        on_orphaned: Callable[[], None],
        on_signals: Callable[[bytes], None],
    ) -> None:
        os.set_inheritable(descriptor, False)
        self._frames = FrameSocket(socket.socket(fileno=descriptor))
        self._on_message, self._on_orphaned, self._on_signals = on_message, on_orphaned, on_signals
        self._lock = threading.Lock()
        self._wake_receiver, self._wake_sender = socket.socketpair()
        self._wake_receiver.setblocking(False)
        self._wake_sender.setblocking(False)
        self._ended = False

    @property
    def wake_descriptor(self) -> int:
        """Descriptor for ``signal.set_wakeup_fd``: a byte written to it reaches ``on_signals``."""
        return self._wake_sender.fileno()

    def start(self) -> None:
        """Starts the control thread."""
        threading.Thread(target=self._run, name="control", daemon=True).start()

    def send(self, message: Message, *, can_miss: bool = False) -> None:
        """Sends or queues a message. Never blocks and never raises.

        Args:
            can_miss: drop the message if the supervisor has not read for long.
        """
        payload = encode(message)
        with self._lock:
            if self._ended or (can_miss and self._frames.pending_bytes > BACKLOG_LIMIT_BYTES):
                return
            try:
                all_sent = self._frames.send(payload)
            except EndOfStreamError:
                self._ended = True  # the control thread sees it too and stops the nodes
                return
        if not all_sent:
            with contextlib.suppress(OSError):  # full: the thread is awake anyway
                self._wake_sender.send(b"\0")

    def drain(self, timeout_s: float) -> None:
        """At the end of the process, waits until everything has been sent."""
        selector = selectors.DefaultSelector()
        selector.register(self._frames.fileno(), selectors.EVENT_WRITE)
        with selector, contextlib.suppress(EndOfStreamError):
            for _ in range(100):
                with self._lock:
                    if self._ended or self._frames.flush():
                        return
                selector.select(timeout_s / 100)

    def _run(self) -> None:
        selector = selectors.DefaultSelector()
        selector.register(self._frames.fileno(), selectors.EVENT_READ, "control")
        selector.register(self._wake_receiver.fileno(), selectors.EVENT_READ, "wake")
        connected = True
        while True:
            for key, events in selector.select():
                if key.data == "wake":
                    numbers = self._wake_receiver.recv(4096).replace(b"\0", b"")
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
        """Reads and writes once. Returns whether the supervisor is still connected."""
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
