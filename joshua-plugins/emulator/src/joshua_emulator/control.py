"""The control channel: a UNIX socket that takes one JSON object a line and answers each with one.

A request names an operation, ``{"op": "state"}``; the answer is ``{"ok": true, …}`` or
``{"ok": false, "error": "…"}``.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import socket
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

MAX_LINE = 1 << 20

Handler = Callable[[dict[str, Any]], dict[str, Any]]


class ControlError(Exception):
    """A request that cannot be executed. The message is returned to the client."""


def listen_at(path: Path) -> socket.socket:
    """Listen at a path for this user only; replace a socket left by an earlier process.

    Raises:
        OSError: the path cannot be used, or is not a socket.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_symlink() or (path.exists() and not path.is_socket()):
        raise FileExistsError(f"{path} already exists and is not a socket; name another path")
    path.unlink(missing_ok=True)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        listener.bind(str(path))
        os.chmod(path, 0o600)  # noqa: PTH101 - the socket file of this process alone
        listener.listen()
    except OSError:
        listener.close()
        raise
    listener.setblocking(False)
    return listener


class ControlServer:
    """Serves requests between cycles of the loop, without a thread."""

    def __init__(self, path: Path, handler: Handler) -> None:
        self.path = path
        self.handler = handler
        self._clients: dict[int, tuple[socket.socket, bytearray]] = {}
        self._listener = listen_at(path)

    def descriptors(self) -> Iterable[int]:
        """File descriptors to wait on."""
        return (self._listener.fileno(), *self._clients)

    def serve(self, ready: Iterable[int]) -> None:
        """Serve the descriptors that are ready."""
        for descriptor in ready:
            if descriptor == self._listener.fileno():
                self._accept()
            elif descriptor in self._clients:
                self._read(descriptor)

    def close(self) -> None:
        """Close all connections and remove the socket file."""
        for client, _ in self._clients.values():
            client.close()
        self._clients.clear()
        self._listener.close()
        self.path.unlink(missing_ok=True)

    def _accept(self) -> None:
        with contextlib.suppress(BlockingIOError):
            client, _ = self._listener.accept()
            self._clients[client.fileno()] = (client, bytearray())

    def _read(self, descriptor: int) -> None:
        client, buffer = self._clients[descriptor]
        try:
            data = client.recv(65536)
        except OSError:
            data = b""
        buffer += data
        if not data or len(buffer) > MAX_LINE:
            self._drop(descriptor)
            return
        while (end := buffer.find(b"\n")) >= 0:
            line = bytes(buffer[:end])
            del buffer[: end + 1]
            try:
                client.sendall(json.dumps(self._answer(line)).encode() + b"\n")
            except OSError:
                self._drop(descriptor)
                return

    def _drop(self, descriptor: int) -> None:
        client, _ = self._clients.pop(descriptor)
        client.close()

    def _answer(self, line: bytes) -> dict[str, Any]:
        try:
            request = json.loads(line, parse_float=_finite, parse_constant=_finite)
        except (ValueError, RecursionError) as error:
            return {"ok": False, "error": f"the line is not a JSON object: {error}"}
        if not isinstance(request, dict) or not isinstance(request.get("op"), str):
            return {"ok": False, "error": 'a request is an object with "op", such as {"op": "state"}'}
        try:
            return {"ok": True, **self.handler(request)}
        except ControlError as error:
            return {"ok": False, "error": str(error)}


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text} is no finite number")
    return number
