"""The control socket of a run: one JSON object a line in, one out, or a stream of events."""

from __future__ import annotations

import contextlib
import json
import socket
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from joshua.guardian.socket_address import socket_address
from joshua.plan.events import Gap, event_record
from joshua.supervisor.event_bus import EventStream
from joshua.supervisor.reactor import Reactor

Request = Mapping[str, Any]


class Deferred:
    """An answer that comes later; one that nobody waits for any more is dropped.

    Attributes:
        abandoned: whether who asked has gone, so that what was asked for is not wanted any more.
    """

    def __init__(self) -> None:
        self.deliver: Callable[[dict[str, Any]], None] | None = None
        self.abandoned = False

    def answer(self, values: dict[str, Any]) -> None:
        """Gives the answer."""
        if self.deliver is not None:
            self.deliver(values)


Handler = Callable[[Request], dict[str, Any] | Deferred | EventStream]

MAX_REQUEST_BYTES = 65536
MAX_CLIENTS = 16

#: Unread bytes of a program beyond which events for it are dropped and counted.
STREAM_BACKLOG_BYTES = 256 * 1024


class ControlServer:
    """Answers requests on a UNIX socket that only this user can reach.

    A request is an object with a member ``request``; the answer is an object, with a member ``error``
    when the request cannot be served.

    Args:
        reactor: the supervisor's loop.
        path: of the socket.
        handlers: by the name of the request.

    Raises:
        OSError: the socket cannot be made.
    """

    def __init__(self, reactor: Reactor, path: Path, handlers: Mapping[str, Handler]) -> None:
        self._reactor = reactor
        self._path = path
        self._handlers = handlers
        self._clients: dict[int, _Client] = {}
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.setblocking(False)
        unheard = path.with_name(f".{path.name}")
        try:
            unheard.unlink(missing_ok=True)
            with socket_address(unheard) as address:
                self._socket.bind(address)
            unheard.chmod(0o600)
            self._socket.listen(MAX_CLIENTS)
            unheard.replace(path)  # who finds it is heard
        except OSError:
            self._socket.close()
            raise
        reactor.watch(self._socket.fileno(), self._accept)

    def close(self) -> None:
        """Closes all connections and removes the socket; a second call does nothing."""
        if self._socket.fileno() < 0:
            return
        self._reactor.forget(self._socket.fileno())
        self._socket.close()
        for client in list(self._clients.values()):
            self._drop(client)
        with contextlib.suppress(OSError):  # whatever has become of its folder meanwhile
            self._path.unlink(missing_ok=True)

    def _accept(self) -> None:
        try:
            connection, _address = self._socket.accept()
        except OSError:
            return  # the client has gone already
        if len(self._clients) >= MAX_CLIENTS:
            connection.close()
            return
        client = _Client(connection)
        self._clients[client.descriptor] = client
        self._reactor.watch(client.descriptor, lambda: self._read(client))

    def _read(self, client: _Client) -> None:
        try:
            data = client.connection.recv(MAX_REQUEST_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        client.incoming += data
        *lines, client.incoming = client.incoming.split(b"\n")
        for line in lines:
            self._reply(client, self._answer(line))
        if not data or len(client.incoming) > MAX_REQUEST_BYTES:
            client.finished = True
        self._write(client)

    def _write(self, client: _Client) -> None:
        try:
            while client.outgoing:
                client.outgoing = client.outgoing[client.connection.send(client.outgoing) :]
        except BlockingIOError:
            self._reactor.watch(client.descriptor, lambda: self._read(client), lambda: self._write(client))
            return
        except OSError:
            client.finished = True
        if client.finished:
            self._drop(client)
        else:
            self._reactor.watch(client.descriptor, lambda: self._read(client))

    def _reply(self, client: _Client, answer: dict[str, Any] | Deferred | EventStream) -> None:
        if isinstance(answer, EventStream):
            client.waits_for.append(answer)
            answer.attach(lambda line: self._stream(client, line))
        elif isinstance(answer, Deferred):
            answer.deliver = lambda values: self._deliver(client, values)
            client.waits_for.append(answer)
        else:
            client.outgoing += json.dumps(answer).encode() + b"\n"

    def _deliver(self, client: _Client, values: dict[str, Any]) -> None:
        if self._clients.get(client.descriptor) is client:
            client.outgoing += json.dumps(values).encode() + b"\n"
            self._write(client)

    def _stream(self, client: _Client, line: bytes) -> None:
        if self._clients.get(client.descriptor) is not client:
            return
        if len(client.outgoing) > STREAM_BACKLOG_BYTES:
            client.dropped += 1
            return
        if client.dropped:
            client.outgoing += json.dumps(event_record(Gap(client.dropped))).encode() + b"\n"
            client.dropped = 0
        client.outgoing += line
        self._write(client)

    def _answer(self, line: bytes) -> dict[str, Any] | Deferred | EventStream:
        try:
            request = json.loads(line)
            name = request["request"]
        except (ValueError, TypeError, KeyError, RecursionError):
            return {"error": 'expected a JSON object with the member "request"'}
        handler = self._handlers.get(name) if isinstance(name, str) else None
        if handler is None:
            return {"error": f"unknown request {name!r}", "allowed": sorted(self._handlers)}
        return handler(request)

    def _drop(self, client: _Client) -> None:
        self._reactor.forget(client.descriptor)
        self._clients.pop(client.descriptor, None)
        client.connection.close()
        for answer in client.waits_for:
            answer.abandoned = True


class _Client:
    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self.connection = connection
        self.descriptor = connection.fileno()
        self.incoming = b""
        self.outgoing = b""
        self.waits_for: list[Deferred | EventStream] = []
        self.dropped = 0
        self.finished = False
