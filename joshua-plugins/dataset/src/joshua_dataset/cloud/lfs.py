"""Send large files to the Hub in Git LFS parts, skipping those that arrived before a kill.

The Hub's client sends all parts again. This path is used if Xet is not installed or is disabled.
"""

from __future__ import annotations

from typing import Any

from joshua_dataset.cloud.sessions import Sessions
from joshua_dataset.cloud.store import Outgoing, Tally

#: Files from this size on are sent in parts if the Hub requests it.
LEAST = 8 << 20

#: HTTP statuses of an expired address.
_GONE = (400, 403, 404, 410)


def send_in_parts(
    repository: str, revision: str | None, item: Outgoing, sessions: Sessions, tally: Tally
) -> int:
    """Send a file, and return the bytes received: all, or 0 if the Hub accepts no parts.

    Raises:
        Exception: of the Hub's client.
    """
    from huggingface_hub.errors import HfHubHTTPError

    found = sessions.get(item)
    if found:
        try:
            return _send(found, item, sessions, tally)
        except HfHubHTTPError as error:
            if getattr(error.response, "status_code", 0) not in _GONE:
                raise
            sessions.forget(item)
    begun = _begin(repository, revision, item)
    return _send(begun, item, sessions, tally) if begun else 0


def _begin(repository: str, revision: str | None, item: Outgoing) -> dict[str, Any]:
    """Return where to send the parts; empty if the Hub has the content or accepts it in one request."""
    from huggingface_hub.lfs import UploadInfo, post_lfs_batch_info

    with item.path.open("rb") as file:
        sample = file.read(512)
    info = UploadInfo(size=item.digest.size, sample=sample, sha256=bytes.fromhex(item.digest.sha256))
    answer: Any = post_lfs_batch_info(
        [info], token=None, repo_type="dataset", repo_id=repository, revision=revision
    )
    upload = answer[0][0].get("actions", {}).get("upload", {}) if answer[0] else {}
    header = dict(upload.get("header") or {})
    part = int(header.get("chunk_size") or 0)
    count = -(-item.digest.size // part) if part else 0
    addresses = [str(header[str(number)]) for number in range(1, count + 1) if str(number) in header]
    if not count or len(addresses) != count:
        return {}
    return {"href": str(upload["href"]), "part": part, "addresses": addresses, "etags": {}}


def _send(session: dict[str, Any], item: Outgoing, sessions: Sessions, tally: Tally) -> int:
    from huggingface_hub import utils
    from huggingface_hub.lfs import LFS_HEADERS

    client: Any = utils
    part, etags, moved = int(session["part"]), dict(session["etags"]), 0
    try:
        with item.path.open("rb") as file:
            for number, address in enumerate(session["addresses"]):
                size = min(part, item.digest.size - number * part)
                if str(number) in etags:
                    tally.resume(size)
                    moved += size
                    continue
                file.seek(number * part)
                answer = client.http_backoff("PUT", address, max_retries=0, data=file.read(size))
                client.hf_raise_for_status(answer)
                etags[str(number)] = answer.headers["etag"]
                sessions.put(item, {**session, "etags": etags})
                moved += size
                tally.add(size)
        parts = [{"partNumber": number + 1, "etag": etags[str(number)]} for number in range(len(etags))]
        whole = {"oid": item.digest.sha256, "parts": parts}
        answer = client.http_backoff("POST", session["href"], json=whole, headers=LFS_HEADERS)
        client.hf_raise_for_status(answer)
    except BaseException:
        tally.resume(-moved)
        raise
    sessions.forget(item)
    return moved
