"""Data sets on any file system that fsspec supports: S3, Google Cloud Storage, SFTP, another disk."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import mimetypes
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from joshua_dataset.cloud.address import Address
from joshua_dataset.cloud.errors import RemoteError, require_library, translated
from joshua_dataset.cloud.ledger import Digest, etag_in_parts
from joshua_dataset.cloud.store import (
    ATTEMPTS,
    CHUNK,
    Outgoing,
    RemoteFile,
    Store,
    Tally,
    in_parallel,
    read_back,
)

#: Part size of a large object, and the maximum number of parts.
PART = 8 << 20
MOST_PARTS = 9000

#: Part sizes of other programs, to recognise their uploads.
PARTS = (PART, 5 << 20, 10 << 20, 15 << 20, 16 << 20, 25 << 20, 32 << 20, 50 << 20, 64 << 20, 100 << 20)

#: HTTP statuses of an expired session.
_GONE = (404, 410)

_MD5 = re.compile(r"[0-9a-f]{32}")
_ETAG = re.compile(r"[0-9a-f]{32}-\d+")

#: Keys under which file systems report the modification time of a file.
_CHANGED = ("mtime", "LastModified", "last_modified", "modified", "updated", "created")


class Bucket(Store):
    """A folder of an fsspec file system.

    Args:
        address: of the folder.
    """

    def __init__(self, address: Address) -> None:
        super().__init__(address)
        require_library(address)
        self._is_object_store = address.scheme in ("s3", "gs")
        with self._translating("opening it"):
            import fsspec

            self._files: Any
            self._files, self._root = fsspec.core.url_to_fs(str(address), **_options(address.scheme))
            self._root = self._root.rstrip("/")

    def listing(self) -> dict[str, RemoteFile]:
        """See ``Store``."""
        with self._translating("listing it"):
            self._files.invalidate_cache()
            if self._is_object_store:
                self._require_bucket()
            try:
                found = self._files.find(self._root, detail=True)
            except FileNotFoundError:
                return {}
        start = len(self._files._strip_protocol(self._root).rstrip("/")) + 1
        files = (_remote_file(path[start:], item) for path, item in found.items())
        return {item.name: item for item in files if item.name}

    def same(self, there: RemoteFile, path: Path, digest: Digest) -> bool | None:
        """See ``Store``."""
        if there.size != digest.size:
            return False
        sums = dict(there.checksums)
        if "md5" in sums:
            return sums["md5"] == digest.md5
        count = int(sums["etag"].partition("-")[2]) if "etag" in sums else 0
        sizes = [size for size in (_part(digest.size), *PARTS) if count and -(-digest.size // size) == count]
        if any(etag_in_parts(path, size) == sums["etag"] for size in dict.fromkeys(sizes)):
            return True
        return None

    def send(self, files: Sequence[Outgoing], tally: Tally, jobs: int) -> Iterator[RemoteFile]:
        """See ``Store``."""
        yield from in_parallel(lambda item: self._send(item, tally), files, jobs)

    def chunks(self, there: RemoteFile, start: int) -> Iterator[bytes]:
        """See ``Store``."""
        while start < there.size:
            with self._translating(f"reading {there.name}"):
                end = min(start + CHUNK, there.size)
                data: bytes = self._files.cat_file(self._at(there.name), start=start, end=end)
            if not data:
                raise RemoteError(f"{self.address}: {there.name} ended at {start} bytes", transient=True)
            start += len(data)
            yield data

    def remove(self, names: Sequence[str]) -> None:
        """See ``Store``."""
        for name in names:
            with self._translating(f"removing {name}"):
                self._files.rm_file(self._at(name))

    def _send(self, item: Outgoing, tally: Tally) -> RemoteFile:
        for _ in range(ATTEMPTS):
            tally.patiently(lambda: self._put(item, tally))
            there = tally.patiently(lambda: self._look(item.name))
            if self._arrived(there, item, tally):
                tally.finish()
                return there
            tally.add(-item.digest.size)
        raise RemoteError(f"{self.address}: {item.name} arrived damaged {ATTEMPTS} times")

    def _put(self, item: Outgoing, tally: Tally) -> None:
        from fsspec.callbacks import Callback

        moved = 0

        class Counting(Callback):  # type: ignore[misc]
            """Adds fsspec's progress on one file to the whole transfer."""

            def relative_update(self, inc: int = 1) -> None:
                nonlocal moved
                moved += inc
                tally.add(inc)

            def absolute_update(self, value: int) -> None:
                self.relative_update(value - moved)

        options = {"chunksize": _part(item.digest.size)} if self._is_object_store else {}
        place = self._at(item.name)
        if self.address.scheme == "s3" and item.digest.size > PART:
            return self._put_parts(item, place, tally)
        if self.address.scheme == "gs" and item.digest.size > PART and not self._is_zonal():
            return self._put_session(item, place, tally)
        try:
            with self._translating(f"sending {item.name}"):
                if not self._is_object_store:  # which has no folders, and would create buckets
                    self._files.makedirs(self._files._parent(place), exist_ok=True)
                self._files.put_file(str(item.path), place, callback=Counting(), **options)
        except RemoteError:
            tally.add(-moved)
            raise
        return tally.add(item.digest.size - moved)

    def _put_parts(self, item: Outgoing, place: str, tally: Tally) -> None:
        """Send an object to S3 in parts, skipping those that an earlier attempt or run has sent."""
        size, (bucket, key, _) = _part(item.digest.size), self._files.split_path(place)
        moved, parts = 0, []
        target = {"Bucket": bucket, "Key": key}
        try:
            with self._translating(f"sending {item.name}"), item.path.open("rb") as file:
                target["UploadId"], there = self._begun(target)
                for number in range(1, -(-item.digest.size // size) + 1):
                    data = file.read(size)
                    etag = f'"{hashlib.md5(data, usedforsecurity=False).hexdigest()}"'
                    if there.get(number) == etag:
                        tally.resume(len(data))
                    else:
                        sent = self._files.call_s3("upload_part", PartNumber=number, Body=data, **target)
                        etag = sent["ETag"]
                        tally.add(len(data))
                    moved += len(data)
                    parts.append({"PartNumber": number, "ETag": etag})
                self._files.call_s3("complete_multipart_upload", MultipartUpload={"Parts": parts}, **target)
        except RemoteError:
            tally.resume(-moved)
            raise

    def _begun(self, target: dict[str, str]) -> tuple[str, dict[int, str]]:
        """Return the id of a multipart upload, begun before or new, and the ETags of its parts."""
        with contextlib.suppress(PermissionError):  # listing such uploads requires a separate permission
            found = self._files.call_s3(
                "list_multipart_uploads", Bucket=target["Bucket"], Prefix=target["Key"]
            )
            for upload in found.get("Uploads", ()):
                if upload["Key"] == target["Key"]:
                    number = upload["UploadId"]
                    listed = self._files.call_s3("list_parts", **target, UploadId=number)
                    return number, {part["PartNumber"]: part["ETag"] for part in listed.get("Parts", ())}
        return self._files.call_s3("create_multipart_upload", **target)["UploadId"], {}

    def _put_session(self, item: Outgoing, place: str, tally: Tally) -> None:
        """Send an object to Google in a session, resuming an earlier attempt or run."""
        size, moved = item.digest.size, 0
        try:
            with self._translating(f"sending {item.name}"), item.path.open("rb") as file:
                session, moved = self._session(item, place)
                tally.resume(moved)
                while moved < size:
                    file.seek(moved)
                    data = file.read(PART)
                    span = f"bytes {moved}-{moved + len(data) - 1}/{size}"
                    there = self._received(session, span, data, size)
                    if there <= moved:
                        raise RemoteError(f"{self.address}: {item.name} was not accepted", transient=True)
                    tally.add(there - moved)
                    moved = there
                self.sessions.forget(item)
        except RemoteError:
            tally.resume(-moved)
            raise

    def _session(self, item: Outgoing, place: str) -> tuple[str, int]:
        """Return the address of an upload, begun before or new, and the number of bytes already received."""
        address = str(self.sessions.get(item).get("address", ""))
        if address:
            try:
                return address, self._received(address, f"bytes */{item.digest.size}", b"", item.digest.size)
            except Exception as error:
                if not isinstance(error, FileNotFoundError) and getattr(error, "code", 0) not in _GONE:
                    raise
        from fsspec.asyn import sync
        from gcsfs.core import initiate_upload

        bucket, key, _ = self._files.split_path(place)
        kind = mimetypes.guess_type(item.path)[0] or "application/octet-stream"
        address = str(sync(self._files.loop, initiate_upload, self._files, bucket, key, kind))
        self.sessions.put(item, {"address": address})
        return address, 0

    def _received(self, session: str, span: str, data: bytes, size: int) -> int:
        """Send some bytes, and return how many bytes of the object the remote has received."""
        headers, content = self._files.call("PUT", session, headers={"Content-Range": span}, data=data)
        if content.strip():
            return size  # the description of the object, which is complete
        return int(headers["Range"].rpartition("-")[2]) + 1 if "Range" in headers else 0

    def _is_zonal(self) -> bool:
        """Return whether the bucket requires another upload protocol."""
        from fsspec.asyn import sync

        ask = getattr(self._files, "_is_zonal_bucket", None)
        with self._translating("opening it"):
            return ask is not None and bool(sync(self._files.loop, ask, self._root.partition("/")[0]))

    def _look(self, name: str) -> RemoteFile:
        with self._translating(f"looking at {name}"):
            place = self._at(name)
            self._files.invalidate_cache(self._files._parent(place))
            return _remote_file(name, self._files.info(place))

    def _arrived(self, there: RemoteFile, item: Outgoing, tally: Tally) -> bool:
        same = self.same(there, item.path, item.digest)
        return same if same is not None else read_back(self, there, tally) == item.digest.sha256

    def _at(self, name: str) -> str:
        return f"{self._root}/{name}"

    def _require_bucket(self) -> None:
        """Raise an error if the bucket does not exist; object stores list it as empty."""
        bucket = self._root.partition("/")[0]
        try:
            self._files.ls(self._root, detail=False)
        except FileNotFoundError as error:
            if not self._files.exists(bucket):
                raise RemoteError(
                    f"{self.address.scheme}://{bucket} does not exist: "
                    "create the bucket, or correct remote_url"
                ) from error

    @contextlib.contextmanager
    def _translating(self, doing: str) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            raise translated(error, self.address, doing) from error


def _part(size: int) -> int:
    """Return the part size of an object: a multiple of PART within the limits of object stores."""
    return PART * max(1, -(-size // (PART * MOST_PARTS)))


def _options(scheme: str) -> dict[str, Any]:
    """Return the library options of a scheme: short timeouts, because the transfer itself retries."""
    options: dict[str, Any] = {"skip_instance_cache": True, "use_listings_cache": False}
    if scheme == "s3":
        retries = {"max_attempts": 2, "mode": "standard"}
        options["config_kwargs"] = {"retries": retries, "connect_timeout": 10, "read_timeout": 30}
    if scheme == "gs" and os.environ.get("STORAGE_EMULATOR_HOST"):
        options["token"] = "anon"  # noqa: S105
    return options


def _remote_file(name: str, item: Any) -> RemoteFile:
    sums = []
    etag = str(item.get("ETag") or item.get("etag") or "").strip('"').lower()
    if item.get("md5Hash"):
        sums.append(("md5", base64.b64decode(item["md5Hash"]).hex()))
    elif "content-md5" in item or _MD5.fullmatch(etag):
        sums.append(("md5", etag))
    elif _ETAG.fullmatch(etag):
        sums.append(("etag", etag))
    changed = next((str(item[key]) for key in _CHANGED if item.get(key)), "")
    return RemoteFile(name, int(item.get("size") or 0), tuple(sums), f"{etag} {changed}".strip())
