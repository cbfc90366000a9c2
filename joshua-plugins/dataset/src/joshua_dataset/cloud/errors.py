"""Errors of remotes, with messages that say what to do and contain no secret."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from typing import Any

from joshua.features import EpisodeError

from joshua_dataset.cloud.address import Address, redacted

#: How to provide credentials for each remote.
CREDENTIALS = {
    "hf": "set HF_TOKEN to a token with write access, or run `hf auth login`",
    "s3": "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE, or run `aws configure`",
    "gs": "set GOOGLE_APPLICATION_CREDENTIALS, or run `gcloud auth application-default login`",
}

_NO_CREDENTIALS = (
    "NoCredentialsError",
    "PartialCredentialsError",
    "CredentialRetrievalError",
    "DefaultCredentialsError",
    "LocalTokenNotFoundError",
    "ProfileNotFound",
)
_EXPIRED = ("RefreshError", "TokenRetrievalError", "SSOTokenLoadError", "UnauthorizedSSOTokenError")
_EXPIRED_CODES = ("ExpiredToken", "ExpiredTokenException", "TokenRefreshRequired", "RequestExpired")
_REFUSED_CODES = (
    "AccessDenied",
    "InvalidAccessKeyId",
    "SignatureDoesNotMatch",
    "InvalidToken",
    "AllAccessDisabled",
)
_ABSENT = ("NoSuchBucket", "RepositoryNotFoundError", "RevisionNotFoundError", "BucketNotFoundError")
_FULL = (errno.ENOSPC, errno.EDQUOT)
_RETRIED_STATUSES = (408, 425, 429, 500, 502, 503, 504)

#: Modules whose otherwise unknown exceptions count as connection errors.
_NETWORK_MODULES = ("aiohttp", "httpx", "httpx2", "httpcore", "httpcore2", "urllib3", "requests", "ssl")
_NETWORK_NAMES = (
    "EndpointConnectionError",
    "ConnectionClosedError",
    "ConnectTimeoutError",
    "ReadTimeoutError",
    "HTTPClientError",
    "IncompleteReadError",
    "ResponseStreamingError",
    "ResponseParserError",
    "FSTimeoutError",
    "IncompleteRead",
    "TransportError",
    "ChecksumError",
)


class RemoteError(EpisodeError):
    """A remote cannot be read or written.

    Attributes:
        transient: a retry may help, because the network or the remote had a fault.
        exit_code: of the program, if this error ends it.
    """

    exit_code = 1

    def __init__(self, message: str, *, transient: bool = False) -> None:
        super().__init__(redacted(message))
        self.transient = transient


class NotInstalledError(RemoteError):
    """The library of a scheme is not installed."""

    exit_code = 3


class StoppedError(RemoteError):
    """A transfer was stopped on request."""


def disk_full(error: BaseException) -> bool:
    """Return whether an error means that a local disk is full."""
    return any(isinstance(item, OSError) and item.errno in _FULL for item in _chain(error))


def translated(error: BaseException, address: Address, doing: str) -> RemoteError:
    """Translate an exception of a remote's library into an error that says what to do.

    Args:
        doing: what failed, such as ``sending meta/info.json``.
    """
    if isinstance(error, RemoteError):
        return error
    chain = list(_chain(error))
    names = [type(item).__name__ for item in chain]
    codes = [code for item in chain if (code := _code(item))]
    status = next((found for item in chain if (found := _status(item))), 0)
    login = CREDENTIALS.get(address.scheme, "see the documentation of this scheme's library")
    if isinstance(error, ImportError):
        return NotInstalledError(f"{address} requires a library that is not installed: {error}")
    if _any(names, _NO_CREDENTIALS):
        return RemoteError(f"no credentials for {address.scheme}://: {login}")
    if _any(names, _EXPIRED) or _any(codes, _EXPIRED_CODES):
        return RemoteError(f"{address} refuses the credentials, which have expired: {login}")
    if _any([*names, *codes], _ABSENT) or _bucket_is_absent(error):
        if address.scheme == "hf":
            return RemoteError(
                f"{address} does not exist, or this account has no access. Correct remote_url, or {login}"
            )
        place = address.path.partition("/")[0]
        return RemoteError(
            f"{address.scheme}://{place} does not exist: create the bucket, or correct remote_url"
        )
    if status == 401:
        return RemoteError(f"{address} refuses the credentials, which are missing, wrong or expired: {login}")
    is_forbidden = status == 403 or str(error).startswith("Forbidden")  # gcsfs does not keep its status
    if is_forbidden or _any(codes, _REFUSED_CODES) or "PermissionError" in names:
        return RemoteError(
            f"{address} refuses access: the credentials are wrong, or lack read or write permission: {login}"
        )
    why = redacted(_shortest(chain))
    network = (
        status in _RETRIED_STATUSES
        or _any(names, _NETWORK_NAMES)
        or any(isinstance(item, (ConnectionError, TimeoutError)) for item in chain)
        or any(type(item).__module__.partition(".")[0] in _NETWORK_MODULES and not status for item in chain)
    )
    hint = "; check the network connection" if network else ""
    return RemoteError(f"{address}: {doing} failed: {why}{hint}", transient=network)


def require_library(address: Address) -> None:
    """Raise NotInstalledError if the library of a scheme is not installed."""
    library, extra = address.missing
    if library:
        from joshua.tools import install

        how = install("joshua-dataset", extra)
        raise NotInstalledError(f"{address.scheme}:// requires {library}, which is not installed: {how}")


def _chain(error: BaseException) -> Iterator[BaseException]:
    seen: set[int] = set()
    current: BaseException | None = error
    while current is not None and id(current) not in seen:
        seen.add(id(current))
        yield current
        current = current.__cause__ or current.__context__


def _any(found: list[str], wanted: tuple[str, ...]) -> bool:
    return any(item in wanted for item in found)


def _code(error: BaseException) -> str:
    """Return the S3 error code."""
    response: Any = getattr(error, "response", None)
    if isinstance(response, dict):
        return str(response.get("Error", {}).get("Code", ""))
    return ""


def _status(error: BaseException) -> int:
    """Return the HTTP status, which libraries keep in different places."""
    response: Any = getattr(error, "response", None)
    if isinstance(response, dict):
        found = response.get("ResponseMetadata", {}).get("HTTPStatusCode", 0)
    elif response is not None:
        found = getattr(response, "status_code", 0)
    else:
        found = getattr(error, "code", 0) or getattr(error, "status", 0)
    try:
        return int(found)
    except (TypeError, ValueError):
        return 0


def _bucket_is_absent(error: BaseException) -> bool:
    text = str(error).lower()
    return "bucket" in text and ("does not exist" in text or "not exist" in text or "not found" in text)


def _shortest(chain: list[BaseException]) -> str:
    """Return the text of the innermost error that has one, on one line."""
    for item in reversed(chain):
        if text := " ".join(str(item).split()):
            return f"{type(item).__name__}: {text[:300]}"
    return type(chain[0]).__name__
