"""The control socket of a run: JSON objects by line, requests in, answers and events out."""

from __future__ import annotations

import contextlib
import json
import socket
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from joshua.ipc.run_bases import socket_address
from joshua.plan.events import Gap, event_record
from joshua.supervisor.reactor import Reactor

Request = Mapping[str, Any]

MAX_REQUEST_BYTES = 65536
MAX_CLIENTS = 16

#: Unread bytes of a client beyond which events for it are dropped and counted.
STREAM_BACKLOG_BYTES = 256 * 1024


class Connection:
    """A client of the control socket.

    Attributes:
        closed: whether the client is gone, so that what it asked for is not wanted any more.
        dropped: events dropped since the last one sent, because the client reads too slowly.
    """

    def __init__(self, server: ControlServer, connection: socket.socket) -> None:
        connection.setblocking(False)
        self.closed = False
        self.dropped = 0
        self._server = server
        self._socket = connection
        self._incoming = b""
        self._outgoing = b""
        self._finished = False
        server.reactor.watch(connection.fileno(), self._read)

    def send(self, values: Mapping[str, Any]) -> None:
        """Sends an answer."""
        if not self.closed:
            self._outgoing += json.dumps(values).encode() + b"\n"
            self._write()

    def offer(self, line: bytes) -> None:
        """Sends the line of an event, or counts it as dropped."""
        if len(self._outgoing) > STREAM_BACKLOG_BYTES:
            self.dropped += 1
        elif not self.closed:
            if self.dropped:
                self._outgoing += json.dumps(event_record(Gap(self.dropped))).encode() + b"\n"
                self.dropped = 0
            self._outgoing += line
            self._write()

    def close(self) -> None:
        """Closes the connection. Idempotent."""
        if not self.closed:
            self.closed = True
            self._server.reactor.forget(self._socket.fileno())
            self._socket.close()
            self._server.clients.discard(self)

    def _read(self) -> None:
        try:
            data = self._socket.recv(MAX_REQUEST_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        self._incoming += data
        *lines, self._incoming = self._incoming.split(b"\n")
        for line in lines:
            self._server.answer(self, line)
        if not data or len(self._incoming) > MAX_REQUEST_BYTES:
            self._finished = True
        self._write()

    def _write(self) -> None:
        if self.closed:
            return
        try:
            while self._outgoing:
                self._outgoing = self._outgoing[self._socket.send(self._outgoing) :]
        except BlockingIOError:
            self._server.reactor.watch(self._socket.fileno(), self._read, self._write)
            return
        except OSError:
            self._finished = True
        if self._finished:
            self.close()
        else:
            self._server.reactor.watch(self._socket.fileno(), self._read)


#: Returns the answer, or None and answers later on the connection.
Handler = Callable[[Request, Connection], "dict[str, Any] | None"]


class ControlServer:
    """Answers requests on a UNIX socket that only this user can reach.

    A request is an object with the member ``request``. The answer is an object, with the member ``error``
    if the request failed.

    Args:
        reactor: the supervisor's loop.
        path: of the socket.
        handlers: by the name of the request.

    Raises:
        OSError: the socket cannot be created.
    """

    def __init__(self, reactor: Reactor, path: Path, handlers: Mapping[str, Handler]) -> None:
        self.reactor = reactor
        self.clients: set[Connection] = set()
        self._path = path
        self._handlers = handlers
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.setblocking(False)
        hidden = path.with_name(f".{path.name}")
        try:
            hidden.unlink(missing_ok=True)
            with socket_address(hidden) as address:
                self._socket.bind(address)
            hidden.chmod(0o600)
            self._socket.listen(MAX_CLIENTS)
            hidden.replace(path)  # a client finds only a socket that listens
        except OSError:
            self._socket.close()
            raise
        reactor.watch(self._socket.fileno(), self._accept)

    def close(self) -> None:
        """Closes all connections and removes the socket. Idempotent."""
        if self._socket.fileno() < 0:
            return
        self.reactor.forget(self._socket.fileno())
        self._socket.close()
        for client in list(self.clients):
            client.close()
        with contextlib.suppress(OSError):  # its folder may be gone
            self._path.unlink(missing_ok=True)

    def answer(self, client: Connection, line: bytes) -> None:
        """Passes a request to its handler."""
        try:
            request = json.loads(line)
            name = request["request"]
        except (ValueError, TypeError, KeyError, RecursionError):
            client.send({"error": 'expected a JSON object with the member "request"'})
            return
        handler = self._handlers.get(name) if isinstance(name, str) else None
        if handler is None:
            client.send({"error": f"unknown request {name!r}", "allowed": sorted(self._handlers)})
        elif (answer := handler(request, client)) is not None:
            client.send(answer)

    def _accept(self) -> None:
        try:
            connection, _address = self._socket.accept()
        except OSError:
            return  # the client is gone already
        if len(self.clients) >= MAX_CLIENTS:
            connection.close()
            return
        self.clients.add(Connection(self, connection))
