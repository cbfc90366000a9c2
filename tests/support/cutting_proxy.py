"""A TCP proxy on loopback that cuts connections after a number of bytes, or refuses them."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Iterator


class CuttingProxy:
    """Forwards to a port.

    Attributes:
        port: to connect to; connections: taken so far; cut: connections that were cut.
        cuts: bytes from the client after which each of the next connections is cut, in order.
        answer_cuts: bytes to the client after which each of the next connections is cut, in order.
        refuses: connections are closed at once; ``refuse`` sets it, and ends those that there are.
    """

    def __init__(self, target: int) -> None:
        self._target = target
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self.cuts: list[int] = []
        self.answer_cuts: list[int] = []
        self.refuses = False
        self.connections = self.cut = 0
        self._lock = threading.Lock()
        self._sockets: set[socket.socket] = set()
        self._accepting = threading.Thread(target=self._accept, daemon=True)
        self._accepting.start()

    def close(self) -> None:
        """End everything."""
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._accepting.join(5)
        for item in list(self._sockets):
            _end(item)

    def refuse(self) -> None:
        """The network is gone until ``refuses`` is false again."""
        self.refuses = True
        for item in list(self._sockets):
            _reset(item)

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            self.connections += 1
            if self.refuses:
                _reset(client)
                continue
            server = socket.create_connection(("127.0.0.1", self._target))
            self._sockets |= {client, server}
            for source, sink, kind in ((client, server, "cuts"), (server, client, "answer_cuts")):
                threading.Thread(target=self._pump, args=(source, sink, kind), daemon=True).start()

    def _pump(self, source: socket.socket, sink: socket.socket, kind: str) -> None:
        passed = 0
        try:
            while data := source.recv(65536):
                passed += len(data)
                with self._lock:
                    limits: list[int] = getattr(self, kind)
                    is_cut = bool(limits) and passed > limits[0]
                    if is_cut:
                        limits.pop(0)
                        self.cut += 1
                if is_cut:
                    _reset(source)
                    _reset(sink)
                    return
                sink.sendall(data)
            sink.shutdown(socket.SHUT_WR)
        except OSError:
            _end(source)
            _end(sink)


def _reset(item: socket.socket) -> None:
    """Close with a reset, as a lost connection looks."""
    with contextlib.suppress(OSError):
        item.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    _end(item)


def _end(item: socket.socket) -> None:
    with contextlib.suppress(OSError):
        item.shutdown(socket.SHUT_RDWR)
    item.close()


@contextlib.contextmanager
def cutting(target: int) -> Iterator[CuttingProxy]:
    """A proxy for a port, closed at the end."""
    proxy = CuttingProxy(target)
    try:
        yield proxy
    finally:
        proxy.close()
