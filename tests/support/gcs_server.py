"""Google Cloud Storage's JSON API on loopback, as far as the unmodified gcsfs uses it; uploads are resumable.

After https://cloud.google.com/storage/docs/json_api/v1 and .../docs/performing-resumable-uploads.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import itertools
import json
import re
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

import google_crc32c

_crc32c: Any = google_crc32c


class GcsServer(ThreadingHTTPServer):
    """Buckets in memory.

    Attributes:
        buckets: name to objects; resumed: chunks of sessions that were taken after the first one.
        refusal: status of every answer, where it is one of an error.
        damage: names of objects whose next upload is stored wrong.
    """

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.buckets: dict[str, dict[str, bytes]] = {}
        self.sessions: dict[str, tuple[str, str, bytearray]] = {}
        self.numbers = itertools.count(1)
        self.resumed = 0
        self.refusal = 0
        self.damage: set[str] = set()

    @property
    def port(self) -> int:
        """It listens on."""
        return int(self.server_address[1])

    def described(self, bucket: str, name: str) -> dict[str, Any]:
        """The resource of an object."""
        content = self.buckets[bucket][name]
        md5 = base64.b64encode(hashlib.md5(content).digest()).decode()
        crc = base64.b64encode(_crc32c.Checksum(content).digest()).decode()
        return {
            "kind": "storage#object",
            "id": f"{bucket}/{name}/1",
            "name": name,
            "bucket": bucket,
            "generation": "1",
            "metageneration": "1",
            "contentType": "application/octet-stream",
            "storageClass": "STANDARD",
            "size": str(len(content)),
            "md5Hash": md5,
            "crc32c": crc,
            "etag": crc,
            "timeCreated": "2026-01-01T00:00:00.000Z",
            "updated": "2026-01-01T00:00:00.000Z",
        }

    def store(self, bucket: str, name: str, content: bytes) -> dict[str, Any]:
        """Keep an object, and describe what was sent."""
        if name in self.damage:
            self.damage.discard(name)
            self.buckets[bucket][name] = content[:-1] + bytes([content[-1] ^ 1])
        else:
            self.buckets[bucket][name] = content
        return self.described(bucket, name)


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: GcsServer

    def log_message(self, *_: Any) -> None:
        """Keep the terminal clean."""

    def do_GET(self) -> None:
        parts = urlsplit(self.path)
        query = {key: values[0] for key, values in parse_qs(parts.query).items()}
        match = re.fullmatch(r"(?:/download)?/storage/v1/b/([^/]+)(?:/o(?:/(.+))?)?", parts.path)
        if self._refused() or match is None:
            return self._error(404, "Not Found") if match is None else None
        bucket, name = match[1], unquote(match[2] or "")
        objects = self.server.buckets.get(bucket)
        if objects is None:
            return self._error(404, "The specified bucket does not exist.")
        if name:
            if name not in objects:
                return self._error(404, f"No such object: {bucket}/{name}")
            if query.get("alt") == "media":
                return self._media(objects[name])
            return self._json(self.server.described(bucket, name))
        if not parts.path.rstrip("/").endswith("/o"):
            return self._json({"kind": "storage#bucket", "name": bucket, "id": bucket})
        return self._list(bucket, query)

    def do_POST(self) -> None:
        body = self._body()
        parts = urlsplit(self.path)
        query = {key: values[0] for key, values in parse_qs(parts.query).items()}
        match = re.fullmatch(r"/upload/storage/v1/b/([^/]+)/o", parts.path)
        if self._refused():
            return None
        if "upload_id" in query:
            return self._chunk(body, query["upload_id"])
        if match is None or match[1] not in self.server.buckets:
            return self._error(404, "The specified bucket does not exist.")
        if query.get("uploadType") == "resumable":
            session = f"session-{next(self.server.numbers)}"
            self.server.sessions[session] = (match[1], query["name"], bytearray())
            host = self.headers["Host"]
            return self._json({}, headers={"Location": f"http://{host}{parts.path}?upload_id={session}"})
        boundary = re.search(r'boundary="?([^";]+)', self.headers["Content-Type"])
        assert boundary is not None
        _, first, second, _ = body.split(f"--{boundary[1]}".encode())
        name = json.loads(first.partition(b"\n\n")[2])["name"]
        content = second.partition(b"\n\n")[2].removesuffix(b"\n")
        return self._json(self.server.store(match[1], name, content))

    def do_PUT(self) -> None:
        """A part of a resumable upload, or the question how much of it is there."""
        body = self._body()
        if not self._refused():
            self._chunk(body, parse_qs(urlsplit(self.path).query)["upload_id"][0])

    def _chunk(self, body: bytes, session: str) -> None:
        """Take a part of a resumable upload; the client sends it again where the answer was lost."""
        found = self.server.sessions.get(session)
        if found is None:
            return self._error(410, "Gone")
        bucket, name, content = found
        match = re.fullmatch(r"bytes (?:(\d+)-(\d+)|\*)/(\d+|\*)", self.headers["Content-Range"])
        assert match is not None
        if match[1] is not None:
            start = int(match[1])
            if start > len(content):
                return self._error(503, "a gap")
            self.server.resumed += start > 0
            content[start:] = body
        if match[3] != "*" and len(content) == int(match[3]):
            return self._json(self.server.store(bucket, name, bytes(content)))
        headers = {"Range": f"bytes=0-{len(content) - 1}"} if content else {}
        return self._answer(308, b"", headers)

    def do_DELETE(self) -> None:
        parts = urlsplit(self.path)
        match = re.fullmatch(r"/storage/v1/b/([^/]+)/o/(.+)", parts.path)
        if match is not None:
            self.server.buckets[match[1]].pop(unquote(match[2]), None)
        self._answer(204, b"", {})

    def _list(self, bucket: str, query: dict[str, str]) -> None:
        prefix, delimiter = query.get("prefix", ""), query.get("delimiter", "")
        items, prefixes = [], set()
        for name in sorted(self.server.buckets[bucket]):
            rest = name.removeprefix(prefix)
            if not name.startswith(prefix):
                continue
            if delimiter and delimiter in rest:
                prefixes.add(prefix + rest.partition(delimiter)[0] + delimiter)
            else:
                items.append(self.server.described(bucket, name))
        start = int(query.get("pageToken") or 0)
        count = 4  # small, so that every listing has several pages
        answer: dict[str, Any] = {"kind": "storage#objects", "items": items[start : start + count]}
        if not start:
            answer["prefixes"] = sorted(prefixes)
        if len(items) > start + count:
            answer["nextPageToken"] = str(start + count)
        self._json(answer)

    def _media(self, content: bytes) -> None:
        match = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
        if match is None:
            return self._answer(200, content, {})
        start, end = int(match[1]), int(match[2] or len(content) - 1)
        part = content[start : end + 1]
        return self._answer(206, part, {"Content-Range": f"bytes {start}-{end}/{len(content)}"})

    def _refused(self) -> bool:
        if self.server.refusal:
            self._error(self.server.refusal, "This account lacks the access.")
        return bool(self.server.refusal)

    def _body(self) -> bytes:
        if self.headers.get("Transfer-Encoding") == "chunked":
            parts = []
            while size := int(self.rfile.readline().split(b";")[0], 16):
                parts.append(self.rfile.read(size))
                self.rfile.readline()
            self.rfile.readline()
            return b"".join(parts)
        size = int(self.headers.get("Content-Length") or 0)
        body = self.rfile.read(size)
        if len(body) < size:
            raise ConnectionError("the request ended early")
        return body

    def _json(self, value: Any, headers: dict[str, str] | None = None) -> None:
        self._answer(200, json.dumps(value).encode(), {"Content-Type": "application/json", **(headers or {})})

    def _error(self, status: int, message: str) -> None:
        body = json.dumps({"error": {"code": status, "message": message, "errors": [{"message": message}]}})
        self._answer(status, body.encode(), {"Content-Type": "application/json"})

    def _answer(self, status: int, body: bytes, headers: dict[str, str]) -> None:
        self.send_response(status)
        for name, value in (headers | {"Content-Length": str(len(body))}).items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def handle(self) -> None:
        with contextlib.suppress(ConnectionError, ValueError):
            super().handle()
