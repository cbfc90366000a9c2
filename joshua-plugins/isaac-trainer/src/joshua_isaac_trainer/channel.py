"""Lines of JSON between the node of the trainer and the process of Isaac Sim."""

from __future__ import annotations

import json
import select
import socket
from typing import Any

#: Longest line, bytes.
_LONGEST = 4_000_000


class Channel:
    """One end of a socket pair. Not for several threads at once."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end
        self._rest = b""

    def send(self, message: dict[str, Any]) -> None:
        """Send a message; a closed other end makes no difference."""
        try:
            self._socket.sendall(json.dumps(message).encode() + b"\n")
        except OSError:
            return

    def receive(self, timeout_s: float | None = None) -> dict[str, Any] | None:
        """Return the next message; None if the other end is closed.

        Raises:
            TimeoutError: none arrives in time.
        """
        while b"\n" not in self._rest:
            ready, _, _ = select.select([self._socket], [], [], timeout_s)
            if not ready:
                raise TimeoutError
            try:
                part = self._socket.recv(65536)
            except OSError:
                part = b""
            if not part or len(self._rest) > _LONGEST:
                return None
            self._rest += part
        line, _, self._rest = self._rest.partition(b"\n")
        message: dict[str, Any] = json.loads(line)
        return message

    def has_news(self) -> bool:
        """Whether a message waits, or the other end is closed."""
        return bool(self._rest) or bool(select.select([self._socket], [], [], 0)[0])

    def close(self) -> None:
        """Close this end. Idempotent."""
        self._socket.close()
