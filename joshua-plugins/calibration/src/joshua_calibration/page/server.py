"""Web server of the page on loopback: files, the board as an event stream, and requests from the buttons.

The address contains a random token. Host and Origin must be the server's own, so no other page, not even one
whose name resolves to this machine, can read the stream or press a button. Every user of the machine can read
the command line of a browser in the process list, so the browser is started with a one-time address.
"""

from __future__ import annotations

import json
import secrets
import threading
from collections.abc import Callable
from dataclasses import asdict
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any

from joshua.tools import parse_json

from joshua_calibration.front_end import Ask, Board, Request

HOST = "127.0.0.1"
MAX_BODY_BYTES = 1024
KEEP_ALIVE_S = 5.0
FILES = {
    "": ("page.html", "text/html; charset=utf-8"),
    "page.css": ("page.css", "text/css; charset=utf-8"),
    "middle-pose.svg": ("middle-pose.svg", "image/svg+xml"),
    "page.js": ("page.js", "text/javascript; charset=utf-8"),
}
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class Channel:
    """State shared by server threads and session: the newest board, and the requests."""

    def __init__(self, ask: Callable[[Request], None]) -> None:
        self.ask = ask
        self._changed = threading.Condition()
        self._text = ""
        self._number = 0
        self._closed = False

    def put(self, board: Board) -> None:
        """Set the newest board; an unchanged board wakes no stream."""
        text = json.dumps(asdict(board), separators=(",", ":"))
        with self._changed:
            if text != self._text:
                self._text, self._number = text, self._number + 1
                self._changed.notify_all()

    def newer(self, number: int, timeout_s: float) -> tuple[int, str] | None:
        """Wait for a board after ``number``; None on timeout or after the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._number > number or self._closed, timeout_s)
            return (self._number, self._text) if self._number > number else None

    @property
    def closed(self) -> bool:
        """Whether the last board was set."""
        return self._closed

    def close(self) -> None:
        """End every stream after it has sent the newest board."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()


class PageServer:
    """The server on a free loopback port; its threads end with the process.

    Args:
        ask: called with each request of the page, on a thread of the server.
    """

    def __init__(self, ask: Callable[[Request], None]) -> None:
        self.token = secrets.token_urlsafe(24)
        self.channel = Channel(ask)
        self._server = _Server((HOST, 0), self.token, self.channel)
        self._thread = threading.Thread(target=self._server.serve_forever, name="page", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """What a browser opens."""
        return f"http://{HOST}:{self._server.server_address[1]}/{self.token}/"

    def opening_address(self) -> str:
        """An address that leads to the page once, for the command line of a browser."""
        return f"http://{HOST}:{self._server.server_address[1]}/{self._server.openings.new()}"

    def close(self) -> None:
        """Stop serving. Idempotent."""
        self.channel.close()
        self._server.shutdown()
        self._server.server_close()


class _Openings:
    """One-time tokens."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._words: set[str] = set()

    def new(self) -> str:
        """Return a new token."""
        word = secrets.token_urlsafe(24)
        with self._lock:
            self._words.add(word)
        return word

    def take(self, word: str) -> bool:
        """Return whether a token was valid, and invalidate it."""
        with self._lock:
            found = word in self._words
            self._words.discard(word)
            return found


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False
    allow_reuse_address = False

    def __init__(self, address: tuple[str, int], token: str, channel: Channel) -> None:
        super().__init__(address, _Handler)
        self.token = token
        self.openings = _Openings()
        self.channel = channel
        port = self.server_address[1]
        self.names = (f"{HOST}:{port}", f"localhost:{port}")

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore browsers that disconnect during a response."""


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    protocol_version = "HTTP/1.1"
    server_version = "joshua"
    sys_version = ""
    timeout = 30.0

    def do_GET(self) -> None:
        """Serve the files of the page and the stream of boards."""
        name = self._permitted_name()
        if name is None:
            return
        if name == "events":
            self._stream()
        elif name in FILES:
            file, kind = FILES[name]
            self._answer(HTTPStatus.OK, (files(__package__) / file).read_bytes(), kind)
        else:
            self._refuse(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        """Handle a request of the page's buttons: an object with ``ask``, and ``joint`` to repeat one."""
        name = self._permitted_name()
        if name is None:
            return
        length = self.headers.get("Content-Length", "")
        origin = self.headers.get("Origin", "")
        if name != "ask":
            self._refuse(HTTPStatus.NOT_FOUND)
        elif origin not in [f"http://{host}" for host in self.server.names]:
            self._refuse(HTTPStatus.FORBIDDEN)
        elif self.headers.get("Content-Type") != "application/json":
            self._refuse(HTTPStatus.UNSUPPORTED_MEDIA_TYPE)
        elif not length.isdecimal() or int(length) > MAX_BODY_BYTES:
            self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
        else:
            request = _request(self.rfile.read(int(length)))
            if request is None:
                self._refuse(HTTPStatus.BAD_REQUEST)
            else:
                self.server.channel.ask(request)
                self._answer(HTTPStatus.NO_CONTENT)

    def _permitted_name(self) -> str | None:
        """Return the requested resource; None if the request was rejected."""
        if self.headers.get("Host") not in self.server.names:
            self._refuse(HTTPStatus.FORBIDDEN)
            return None
        if self.headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin"):
            self._refuse(HTTPStatus.FORBIDDEN)
            return None
        if self.command == "GET" and self.server.openings.take(self.path[1:]):
            self._answer(HTTPStatus.SEE_OTHER, location=f"/{self.server.token}/")
            return None
        _, token, *rest = [*self.path.split("/", 2), ""]
        if not secrets.compare_digest(token.encode(), self.server.token.encode()) or self.path.count("/") < 2:
            self._refuse(HTTPStatus.NOT_FOUND)
            return None
        return rest[0]

    def _stream(self) -> None:
        channel, number = self.server.channel, 0
        self.close_connection = True
        self.send_response(HTTPStatus.OK)
        for header, value in HEADERS.items():
            self.send_header(header, value)
        self.send_header("Content-Type", "text/event-stream; charset=utf-8")
        self.send_header("Connection", "close")
        self.end_headers()
        while True:
            found = channel.newer(number, KEEP_ALIVE_S)
            if found is not None:
                number, text = found
                self.wfile.write(f"data: {text}\n\n".encode())
            elif channel.closed:
                return
            else:
                self.wfile.write(b": still here\n\n")

    def _refuse(self, status: HTTPStatus) -> None:
        self.close_connection = True
        self._answer(status, f"{status.value} {status.phrase}\n".encode(), "text/plain; charset=utf-8")

    def _answer(self, status: HTTPStatus, body: bytes = b"", kind: str = "", location: str = "") -> None:
        self.send_response(status)
        for header, value in HEADERS.items():
            self.send_header(header, value)
        if kind:
            self.send_header("Content-Type", kind)
        if location:
            self.send_header("Location", location)
        if status is not HTTPStatus.NO_CONTENT:
            self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - the name of the base class
        """Log nothing: the terminal shows the table."""


def _request(body: bytes) -> Request | None:
    try:
        content = parse_json(body)
        joint = content.get("joint", -1)
        if isinstance(joint, bool) or not isinstance(joint, int):
            return None
        return Request(Ask(content["ask"]), joint)
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
