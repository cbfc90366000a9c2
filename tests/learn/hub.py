"""Stands for the Hugging Face hub: gives files by its HTTP interface, to the unmodified client."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

COMMIT = "0123456789abcdef0123456789abcdef01234567"


class Hub:
    """What the stand-in holds.

    Attributes:
        folders: of models, by id; gated, private: ids that need access granted, or a token.
        asked: what was asked for; endpoint: for HF_ENDPOINT.
    """

    def __init__(self) -> None:
        self.folders: dict[str, Path] = {}
        self.gated: set[str] = set()
        self.private: dict[str, str] = {}
        self.asked: list[str] = []
        self.endpoint = ""

    def refusal(self, name: str, revision: str, token: str) -> tuple[int, str]:
        """Status and error code for a question about a model; 200 where it is answered."""
        if name in self.gated:
            return 403, "GatedRepo"
        if name not in self.folders or (name in self.private and token != self.private[name]):
            return 401, "RepoNotFound"
        return (200, "") if revision in ("main", COMMIT) else (404, "RevisionNotFound")


@contextmanager
def hub() -> Iterator[Hub]:
    """Serves a hub on this machine."""
    state = Hub()

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def log_message(self, *_: Any) -> None:
            """Says nothing."""

        def do_HEAD(self) -> None:
            self._answer(with_content=False)

        def do_GET(self) -> None:
            self._answer(with_content=True)

        def _answer(self, *, with_content: bool) -> None:
            path = self.path.partition("?")[0].strip("/")
            state.asked.append(path)
            token = self.headers.get("Authorization", "").removeprefix("Bearer ")
            if path.startswith("api/models/"):
                name, _, rest = path.removeprefix("api/models/").partition("/revision/")
                revision = rest or "main"
                status, code = state.refusal(name, revision, token)
                content = json.dumps(self._info(name)).encode() if status == 200 else b"{}"
                return self._send(status, code, content, with_content)
            name, _, rest = path.partition("/resolve/")
            revision, _, file = rest.partition("/")
            status, code = state.refusal(name, revision, token)
            place = state.folders.get(name, Path()) / file
            if status == 200 and not place.is_file():
                status, code = 404, "EntryNotFound"
            return self._send(status, code, place.read_bytes() if status == 200 else b"", with_content)

        def _info(self, name: str) -> dict[str, Any]:
            folder = state.folders[name]
            files = sorted(
                path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()
            )
            siblings = [{"rfilename": file} for file in files]
            return {"_id": name, "id": name, "modelId": name, "sha": COMMIT, "siblings": siblings, "tags": []}

        def _send(self, status: int, code: str, content: bytes, with_content: bool) -> None:
            self.send_response(status)
            if code:
                self.send_header("X-Error-Code", code)
                self.send_header("X-Error-Message", code)
            self.send_header("X-Repo-Commit", COMMIT)
            self.send_header("ETag", f'"{hashlib.sha1(content).hexdigest()}"')
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            if with_content:
                self.wfile.write(content)

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    state.endpoint = f"http://127.0.0.1:{server.server_port}"
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield state
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
