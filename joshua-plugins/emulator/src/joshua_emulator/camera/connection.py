"""One HTTP client of an emulated camera: its request and its pending frames."""

from __future__ import annotations

import contextlib
import socket
import time
from collections import deque
from collections.abc import Callable

BOUNDARY = b"joshua-camera-frame"
STREAM_PATHS = ("/", "/stream.mjpg")
PICTURE_PATH = "/picture.jpg"

# Called when the last chunk was passed to the system; the reader may have it before the call returns.
Sent = Callable[[float], None]

_MAX_REQUEST = 16_384
_SEND_BUFFER = 1 << 18


class Connection:
    """A client with a non-blocking socket.

    Attributes:
        streaming: it requested the stream; wants_picture: it requested one picture.
        begun: it has received a frame of the stream.
    """

    def __init__(self, peer: socket.socket) -> None:
        self.socket = peer
        self.streaming = False
        self.wants_picture = False
        self.begun = False
        self.closed = False
        self._request = b""
        self._queue: deque[tuple[memoryview, Sent | None]] = deque()
        self._close_when_sent = False
        peer.setblocking(False)
        peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)

    @property
    def sending(self) -> bool:
        """Whether bytes are pending for the client."""
        return bool(self._queue)

    def fileno(self) -> int:
        """File descriptor to wait on."""
        return self.socket.fileno()

    def receive(self) -> None:
        """Read from the client, and answer its request once it is complete."""
        try:
            data = self.socket.recv(65_536)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self.close()
            return
        if self.streaming or self.wants_picture or self._close_when_sent:
            return  # one request per connection; ignore the rest
        self._request += data
        if b"\r\n\r\n" in self._request:
            self._answer()
        elif len(self._request) > _MAX_REQUEST:
            self._refuse("431 Request Header Fields Too Large", "the request is too long")

    def send_frame(self, frame: bytes, number: int, sent: Sent) -> None:
        """Send one frame of the stream; ``sent`` is called when its last byte was passed to the system."""
        self.begun = True
        head = b"--%s\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\nX-Frame-Number: %d\r\n\r\n" % (
            BOUNDARY,
            len(frame),
            number,
        )
        self._send(head + frame + b"\r\n", sent)

    def send_picture(self, frame: bytes) -> None:
        """Answer with one picture and end the connection."""
        self._send(_response("200 OK", "image/jpeg", frame))
        self._close_when_sent = True
        self.wants_picture = False
        self.flush()

    def flush(self) -> None:
        """Send as many pending bytes as the client accepts."""
        while self._queue:
            data, sent = self._queue[0]
            handed_over_s = time.monotonic()
            try:
                count = self.socket.send(data)
            except BlockingIOError:
                return
            except OSError:
                self.close()
                return
            if count < len(data):
                self._queue[0] = (data[count:], sent)
                return
            self._queue.popleft()
            if sent is not None:
                sent(handed_over_s)
        if self._close_when_sent:
            self.close()

    def close(self) -> None:
        """End the connection. Idempotent."""
        self.closed = True
        self._queue.clear()
        with contextlib.suppress(OSError):
            self.socket.close()

    def _answer(self) -> None:
        line = self._request.split(b"\r\n", 1)[0].decode("latin-1").split(" ")
        if len(line) != 3 or not line[2].startswith("HTTP/1."):
            self._refuse("400 Bad Request", "this is no HTTP/1 request")
            return
        method, path = line[0], line[1].partition("?")[0]
        if method not in ("GET", "HEAD"):
            self._refuse("405 Method Not Allowed", "allowed: GET, HEAD")
        elif path in STREAM_PATHS:
            kind = f"multipart/x-mixed-replace; boundary={BOUNDARY.decode()}"
            self._send(_response("200 OK", kind))
            self.streaming = method == "GET"
            self._close_when_sent = not self.streaming
            self.flush()
        elif path == PICTURE_PATH and method == "GET":
            self.wants_picture = True
        elif path == PICTURE_PATH:
            self._send(_response("200 OK", "image/jpeg"))
            self._close_when_sent = True
            self.flush()
        else:
            self._refuse("404 Not Found", f"allowed: {', '.join((*STREAM_PATHS, PICTURE_PATH))}")

    def _refuse(self, status: str, reason: str) -> None:
        self._send(_response(status, "text/plain; charset=utf-8", f"{reason}\n".encode()))
        self._close_when_sent = True
        self.flush()

    def _send(self, data: bytes, sent: Sent | None = None) -> None:
        waiting = self.sending
        self._queue.append((memoryview(data), sent))
        if not waiting:
            self.flush()


def _response(status: str, kind: str, body: bytes | None = None) -> bytes:
    lines = [f"HTTP/1.1 {status}", f"Content-Type: {kind}", "Cache-Control: no-store", "Connection: close"]
    if body is not None:
        lines.append(f"Content-Length: {len(body)}")
    return "\r\n".join([*lines, "", ""]).encode("ascii") + (body or b"")
