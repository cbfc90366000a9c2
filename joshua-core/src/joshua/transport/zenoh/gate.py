"""The door on loopback: it lets this user's programs command, and those of other users only watch.

Zenoh cannot tell who is at the other end of a TCP connection. The system can, so each connection is
accepted here and passed on. Those of this user and of root go to the router's UNIX socket and may command.
All others go to a TCP port on which the router accepts no commands.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import socket
import threading
from collections.abc import Sequence

from joshua.transport.zenoh.endpoints import Endpoint
from joshua.transport.zenoh.owners import is_trusted, peer_owner

_log = logging.getLogger("joshua.transport")
_BACKLOG = 64
_CHUNK_B = 1 << 18
#: Connections of other users at the same time. Each needs two threads here.
_MOST_WATCHERS = 32


class Gate:
    """Accepts the connections of loopback endpoints and passes them on, each by the user who made it.

    Args:
        endpoints: such as ``tcp/localhost:7447``. A host name stands for each of its addresses.

    Raises:
        OSError: an address is in use or does not exist.
    """

    def __init__(self, endpoints: Sequence[Endpoint]) -> None:
        self._own = ""
        self._watch: tuple[str, int] | None = None
        self._lock = threading.Lock()
        self._links: set[socket.socket] = set()
        self._watchers = 0
        self._refused = False
        self._closed = False
        self._listeners: list[socket.socket] = []
        try:
            for endpoint in endpoints:
                self._listeners += _listen(endpoint)
        except OSError:
            self.close()
            raise

    def open(self, own: str, watch: tuple[str, int]) -> None:
        """Start to accept connections.

        Args:
            own: path of the UNIX socket for this user and root.
            watch: address of the router's TCP port for everyone else.
        """
        self._own, self._watch = own, watch
        for listener in self._listeners:
            threading.Thread(target=self._accept, args=(listener,), name="joshua-gate", daemon=True).start()

    def close(self) -> None:
        """Stop accepting, and end every connection. Idempotent."""
        with self._lock:
            self._closed = True
            links = [*self._listeners, *self._links]
            self._listeners, self._links = [], set()
        for link in links:
            with contextlib.suppress(OSError):  # not connected, or closed by its thread meanwhile
                link.shutdown(socket.SHUT_RDWR)
            link.close()

    def _accept(self, listener: socket.socket) -> None:
        while True:
            try:
                link, _ = listener.accept()
            except OSError as error:
                if self._closed:
                    return
                _log.warning("a connection to the Zenoh router was not accepted: %s", error.strerror)
                threading.Event().wait(0.1)  # out of descriptors: others must be closed first
                continue
            try:
                self._pass_on(link)
            except (OSError, RuntimeError) as error:  # the latter if no thread can be started
                _log.warning("a connection to the Zenoh router was not passed on: %s", error)
                link.close()

    def _pass_on(self, link: socket.socket) -> None:
        trusted = is_trusted(peer_owner(link))
        if not trusted and not self._admit_watcher():
            link.close()
            return
        try:
            onward = self._connect(trusted)
        except OSError:
            link.close()
            self._ended(trusted)
            return
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with self._lock:
            closed = self._closed
            self._links |= set() if closed else {link, onward}
        if closed:
            link.close()
            onward.close()
            return
        ends = _Ends(self, link, onward, trusted)
        for source, target in ((link, onward), (onward, link)):
            threading.Thread(target=ends.copy, args=(source, target), name="joshua-gate", daemon=True).start()

    def _connect(self, trusted: bool) -> socket.socket:
        if not trusted:
            assert self._watch is not None
            onward = socket.create_connection(self._watch)
            onward.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return onward
        onward = socket.socket(socket.AF_UNIX)
        try:
            onward.connect(self._own)
        except OSError:
            onward.close()
            raise
        return onward

    def _admit_watcher(self) -> bool:
        with self._lock:
            if self._watchers < _MOST_WATCHERS:
                self._watchers += 1
                return True
            said, self._refused = self._refused, True
        if not said:
            _log.warning(
                "%d programs of other users watch this robot over Zenoh: further ones are refused",
                _MOST_WATCHERS,
            )
        return False

    def forget(self, ends: _Ends) -> None:
        """Drop a connection that has ended."""
        with self._lock:
            self._links -= {ends.link, ends.onward}
        self._ended(ends.trusted)

    def _ended(self, trusted: bool) -> None:
        if not trusted:
            with self._lock:
                self._watchers -= 1


class _Ends:
    """The two ends of one connection. The first thread that fails ends both."""

    def __init__(self, gate: Gate, link: socket.socket, onward: socket.socket, trusted: bool) -> None:
        self.link, self.onward, self.trusted = link, onward, trusted
        self._gate = gate
        self._running = 2
        self._lock = threading.Lock()

    def copy(self, source: socket.socket, target: socket.socket) -> None:
        """Copy until one end closes. The last of both threads closes the sockets."""
        buffer = memoryview(bytearray(_CHUNK_B))
        with contextlib.suppress(OSError):  # either end is gone
            while count := source.recv_into(buffer):
                target.sendall(buffer[:count])
        for end in (self.link, self.onward):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        with self._lock:
            self._running -= 1
            last = self._running == 0
        if last:
            self._gate.forget(self)
            self.link.close()
            self.onward.close()


def _listen(endpoint: Endpoint) -> list[socket.socket]:
    """Listen on every loopback address of a host. Raises OSError if one of them is in use."""
    found = socket.getaddrinfo(endpoint.host, endpoint.port, type=socket.SOCK_STREAM)
    listeners: list[socket.socket] = []
    refusals: list[OSError] = []
    for family, kind, protocol, _, address in dict.fromkeys(found):
        try:
            listener = socket.socket(family, kind, protocol)
        except OSError as error:  # a system without IPv6
            refusals.append(error)
            continue
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            listener.bind(address)
            listener.listen(_BACKLOG)
        except OSError as error:
            listener.close()
            refusals.append(error)
        else:
            listeners.append(listener)
    in_use = [error for error in refusals if error.errno == errno.EADDRINUSE]
    if in_use or not listeners:
        for listener in listeners:
            listener.close()
        raise (in_use or refusals)[0]
    return listeners
