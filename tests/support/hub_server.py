"""The Hugging Face Hub's HTTP interface on loopback, as far as the unmodified huggingface_hub client uses it.

Repositories of data, commits, LFS by its batch API in one part and in several, trees, files by range, tags.
After https://huggingface.co/docs/hub/api and https://github.com/git-lfs/git-lfs/blob/main/docs/api/batch.md.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import re
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

TOKEN = "hf_writesforthetests"

#: Content of at least so many bytes is LFS, whatever its name; above PART it goes in several parts.
LFS_FROM = 50_000
PART = 1 << 20
#: The commit that every answer names.
COMMIT = "0" * 40

LFS_SUFFIXES = (".parquet", ".mp4", ".bin")


@dataclass
class Repository:
    """Of data: files by branch, tags, titles of the commits."""

    private: bool
    branches: dict[str, dict[str, bytes]] = field(default_factory=lambda: {"main": {}})
    tags: dict[str, str] = field(default_factory=dict)
    commits: list[str] = field(default_factory=list)

    def files(self, revision: str) -> dict[str, bytes] | None:
        """The files of a branch, a tag, or the only commit that clients are told of."""
        branch = "main" if revision == COMMIT else self.tags.get(revision, revision)
        return self.branches.get(branch)


class HubServer(ThreadingHTTPServer):
    """A Hub in memory.

    Attributes:
        repositories: by name; lfs: contents by SHA-256; puts: uploads of contents or of parts.
        refusal: status of every answer, where it is one of an error.
        damage: paths whose next content is kept wrong.
        closed: the token may read and not write.
    """

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.repositories: dict[str, Repository] = {}
        self.lfs: dict[str, bytes] = {}
        self.parts: dict[str, dict[int, bytes]] = {}
        self.puts: list[str] = []
        self.refusal = 0
        self.damage: set[str] = set()
        self.closed = False

    @property
    def port(self) -> int:
        """It listens on."""
        return int(self.server_address[1])


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: HubServer

    def log_message(self, *_: Any) -> None:
        """Keep the terminal clean."""

    def do_GET(self) -> None:
        self._route("GET")

    def do_HEAD(self) -> None:
        self._route("HEAD")

    def do_POST(self) -> None:
        self._route("POST")

    def do_PUT(self) -> None:
        self._route("PUT")

    def do_DELETE(self) -> None:
        self._route("DELETE")

    def _route(self, method: str) -> None:
        body = self._body()
        parts = urlsplit(self.path)
        path = parts.path
        if self.server.refusal:
            return self._error(self.server.refusal, "refused")
        if match := re.fullmatch(r"/storage/(\w+)(?:/(\d+))?", path):  # addresses that need no token
            return self._stored(match[1], int(match[2] or 0), body)
        if match := re.fullmatch(r"/storage-complete/(\w+)", path):
            return self._complete(match[1])
        if self.headers.get("Authorization") != f"Bearer {TOKEN}":
            return self._error(401, "Invalid username or password.")
        if self.server.closed and method in ("POST", "DELETE") and "paths-info" not in path:
            return self._error(403, "Forbidden: you must use a token with write access")
        if path == "/api/whoami-v2":
            return self._json({"name": "me", "type": "user", "auth": {"type": "access_token"}})
        if path == "/api/repos/create":
            return self._create(json.loads(body))
        if path == "/api/validate-yaml":
            return self._json({"errors": [], "warnings": []})
        if match := re.fullmatch(r"/datasets/([^/]+/[^/]+)\.git/info/lfs/objects/batch", path):
            return self._batch(json.loads(body))
        if match := re.fullmatch(r"/datasets/([^/]+/[^/]+)/resolve/([^/]+)/(.+)", path):
            return self._resolve(match[1], unquote(match[2]), unquote(match[3]))
        match = re.fullmatch(r"/api/datasets/([^/]+/[^/]+)(?:/(\w[\w-]*)(?:/(.+))?)?", path)
        repository = self.server.repositories.get(match[1]) if match else None
        if match is None or repository is None:
            return self._error(404, "Repository not found", "RepoNotFound")
        word, rest = match[2] or "revision", unquote(match[3] or "main")
        if word == "tag":
            return self._tag(repository, method, rest, body)
        if word == "branch":
            repository.branches.setdefault(rest, dict(repository.branches["main"]))
            return self._json({})
        if word == "refs":
            named = {
                kind: [{"name": name, "ref": f"refs/{kind}/{name}", "targetCommit": COMMIT} for name in names]
                for kind, names in (("branches", repository.branches), ("tags", repository.tags))
            }
            return self._json({**named, "converts": []})
        revision = rest.partition("/")[0]
        files = repository.files(revision)
        if files is None:
            return self._error(404, "Invalid rev id", "RevisionNotFound")
        if word == "tree":
            start = int(parse_qs(parts.query).get("cursor", ["0"])[0])
            entries = [_entry(name, files[name]) for name in sorted(files)]
            return self._page(entries, start, path)
        if word == "paths-info":
            wanted = parse_qs(body.decode())["paths"]
            return self._json([_entry(name, files[name]) for name in wanted if name in files])
        if word == "preupload":
            found = json.loads(body)["files"]
            return self._json({"files": [_mode(item, files) for item in found]})
        if word == "commit":
            return self._commit(match[1], repository, files, body)
        siblings = [{"rfilename": name} for name in sorted(files)]
        found = {"id": match[1], "sha": COMMIT, "private": repository.private, "siblings": siblings}
        return self._json(found)

    def _create(self, wanted: dict[str, Any]) -> None:
        name = f"{wanted.get('organization') or 'me'}/{wanted['name']}"
        url = f"http://{self.headers['Host']}/datasets/{name}"
        if name in self.server.repositories:
            return self._json({"error": "You already created this dataset repo", "url": url}, 409)
        self.server.repositories[name] = Repository(
            wanted.get("visibility") == "private" or bool(wanted.get("private"))  # of older clients
        )
        return self._json({"url": url, "name": name, "id": "1"})

    def _batch(self, wanted: dict[str, Any]) -> None:
        objects = []
        for item in wanted["objects"]:
            oid, size = item["oid"], item["size"]
            answer: dict[str, Any] = {"oid": oid, "size": size}
            if oid not in self.server.lfs:
                base = f"http://{self.headers['Host']}"
                upload: dict[str, Any] = {"href": f"{base}/storage/{oid}", "header": {}}
                if size > PART:
                    count = -(-size // PART)
                    header = {str(number): f"{base}/storage/{oid}/{number}" for number in range(1, count + 1)}
                    upload = {
                        "href": f"{base}/storage-complete/{oid}",
                        "header": {"chunk_size": str(PART), **header},
                    }
                answer["actions"] = {"upload": upload}
            objects.append(answer)
        self._json({"transfer": "basic", "objects": objects})

    def _stored(self, oid: str, part: int, body: bytes) -> None:
        self.server.puts.append(f"{oid}/{part}")
        if part:
            self.server.parts.setdefault(oid, {})[part] = body
        elif hashlib.sha256(body).hexdigest() != oid:
            return self._error(400, "the content has another checksum")
        else:
            self.server.lfs[oid] = body
        return self._answer(200, b"", {"ETag": hashlib.md5(body).hexdigest()})

    def _complete(self, oid: str) -> None:
        parts = self.server.parts.pop(oid, {})
        content = b"".join(parts[number] for number in sorted(parts))
        if hashlib.sha256(content).hexdigest() != oid:
            return self._error(400, "the content has another checksum")
        self.server.lfs[oid] = content
        return self._json({})

    def _commit(self, name: str, repository: Repository, files: dict[str, bytes], body: bytes) -> None:
        lines = [json.loads(line) for line in body.splitlines() if line]
        for line in lines:
            value = line["value"]
            if line["key"] == "header":
                repository.commits.append(value["summary"])
            elif line["key"] == "file":
                content = base64.b64decode(value["content"])
                if value["path"] in self.server.damage:
                    self.server.damage.discard(value["path"])
                    content = content[:-1] + bytes([content[-1] ^ 1])
                files[value["path"]] = content
            elif line["key"] == "lfsFile":
                if value["oid"] not in self.server.lfs:
                    return self._error(400, f"the LFS object of {value['path']} is missing")
                files[value["path"]] = self.server.lfs[value["oid"]]
            elif line["key"] == "deletedFile":
                files.pop(value["path"], None)
        oid = hashlib.sha1(str(len(repository.commits)).encode()).hexdigest()
        url = f"http://{self.headers['Host']}/datasets/{name}/commit/{oid}"
        return self._json({"success": True, "commitOid": oid, "commitUrl": url, "hookOutput": ""})

    def _tag(self, repository: Repository, method: str, rest: str, body: bytes) -> None:
        if method == "DELETE":
            if repository.tags.pop(rest, None) is None:
                return self._error(404, "Invalid rev id", "RevisionNotFound")
        else:
            repository.tags[json.loads(body)["tag"]] = rest
        return self._json({})

    def _resolve(self, name: str, revision: str, path: str) -> None:
        repository = self.server.repositories.get(name)
        content = (repository.files(revision) or {}).get(path) if repository else None
        if content is None:
            return self._error(404, "Entry not found", "EntryNotFound")
        headers = {"ETag": f'"{hashlib.sha1(content).hexdigest()}"', "X-Repo-Commit": COMMIT}
        match = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
        if match is None:
            return self._answer(200, content, headers)
        start, end = int(match[1]), min(int(match[2] or len(content) - 1), len(content) - 1)
        headers["Content-Range"] = f"bytes {start}-{end}/{len(content)}"
        return self._answer(206, content[start : end + 1], headers)

    def _page(self, entries: list[dict[str, Any]], start: int, path: str) -> None:
        count = 5  # small, so that every tree has several pages
        headers = {"Content-Type": "application/json"}
        if len(entries) > start + count:
            url = f"http://{self.headers['Host']}{path}?recursive=true&cursor={start + count}"
            headers["Link"] = f'<{url}>; rel="next"'
        self._answer(200, json.dumps(entries[start : start + count]).encode(), headers)

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

    def _json(self, value: Any, status: int = 200) -> None:
        self._answer(status, json.dumps(value).encode(), {"Content-Type": "application/json"})

    def _error(self, status: int, message: str, code: str = "") -> None:
        headers = {"Content-Type": "application/json", "X-Error-Message": message}
        if code:
            headers["X-Error-Code"] = code
        self._answer(status, json.dumps({"error": message}).encode(), headers)

    def _answer(self, status: int, body: bytes, headers: dict[str, str]) -> None:
        self.send_response(status)
        for name, value in (headers | {"Content-Length": str(len(body))}).items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def handle(self) -> None:
        with contextlib.suppress(ConnectionError, ValueError):
            super().handle()


def _is_lfs(name: str, size: int) -> bool:
    return name.endswith(LFS_SUFFIXES) or size >= LFS_FROM


def _mode(item: dict[str, Any], files: dict[str, bytes]) -> dict[str, Any]:
    there = files.get(item["path"])
    mode = "lfs" if _is_lfs(item["path"], item["size"]) else "regular"
    answer = {"path": item["path"], "uploadMode": mode, "shouldIgnore": False}
    if there is not None:
        entry = _entry(item["path"], there)
        answer["oid"] = entry["lfs"]["oid"] if "lfs" in entry else entry["oid"]
    return answer


def _entry(name: str, content: bytes) -> dict[str, Any]:
    oid = hashlib.sha1(f"blob {len(content)}\0".encode() + content).hexdigest()
    entry: dict[str, Any] = {"type": "file", "path": name, "size": len(content), "oid": oid}
    if _is_lfs(name, len(content)):
        sha256 = hashlib.sha256(content).hexdigest()
        entry["lfs"] = {"oid": sha256, "size": len(content), "pointerSize": 134}
    return entry
