"""Addresses of remote data sets, and what must never be shown of them.

Settings import this module while a file is checked, so it imports no library of a remote.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import entry_points
from importlib.util import find_spec

#: Schemes with an extra of this distribution: module, extra, form of an address.
EXTRAS = {
    "hf": ("huggingface_hub", "hf", "hf://datasets/NAME/DATA"),
    "s3": ("s3fs", "s3", "s3://BUCKET/FOLDER"),
    "gs": ("gcsfs", "gs", "gs://BUCKET/FOLDER"),
}

#: Other names of these schemes.
ALIASES = {"gcs": "gs", "s3a": "s3"}

FORMS = tuple(form for _, _, form in EXTRAS.values())

_HUB = re.compile(
    r"datasets/(?P<repo>[\w.-]+/[\w.-]+)(?:@(?P<revision>[\w.~%-]+))?(?:/(?P<folder>.+))?", re.ASCII
)

#: What tokens and keys of the usual remotes look like.
_TOKENS = re.compile(
    r"hf_[A-Za-z0-9]{8,}|(?:AKIA|ASIA)[A-Z0-9]{12,}|ya29\.[\w.-]{8,}|gh[pousr]_\w{16,}|AIza[\w-]{20,}"
)

#: User and password in an address, what follows a question mark in one, and an authorization header.
_USER = re.compile(r"(?<=://)[^/\s@:]*:[^/\s@]*(?=@)")
_QUERY = re.compile(r"(\b[a-z][a-z0-9+.-]*://[^\s?'\"]+)\?[^\s'\"]+", re.IGNORECASE)
_BEARER = re.compile(r"\b(Bearer|Basic)\s+[\w.~+/=-]{6,}", re.IGNORECASE)

#: Names of environment variables whose values are secrets.
_SECRET_NAME = re.compile(r"TOKEN|SECRET|PASSWORD|PASSWD|CREDENTIAL|ACCESS_KEY|API_KEY", re.IGNORECASE)

HIDDEN = "(hidden)"


class AddressError(ValueError):
    """An address cannot be used.

    Attributes:
        allowed: addresses that can; remedy: what to do.
    """

    def __init__(self, message: str, *, allowed: tuple[str, ...] = (), remedy: str = "") -> None:
        super().__init__(message)
        self.allowed, self.remedy = allowed, remedy


@dataclass(frozen=True)
class Address:
    """Where a remote data set is.

    Attributes:
        scheme: such as ``s3``; path: what follows ``://``, without a slash at its end.
    """

    scheme: str
    path: str

    def __str__(self) -> str:
        return f"{self.scheme}://{self.path}"

    @classmethod
    def parse(cls, text: str) -> Address:
        """Read an address. Raises AddressError, whose text holds no secret."""
        if holds_secret(text):
            raise AddressError(
                "the address holds a password or a token",
                remedy="Remove it. Credentials come from the environment (HF_TOKEN, AWS_ACCESS_KEY_ID, "
                "GOOGLE_APPLICATION_CREDENTIALS) or from the files that the tool of the remote writes",
            )
        scheme, colon, path = text.strip().partition("://")
        scheme = ALIASES.get(scheme.lower(), scheme.lower())
        if not colon:
            raise AddressError(f"{text!r} is no address: it has no scheme such as s3://", allowed=FORMS)
        if scheme not in EXTRAS and scheme not in _others():
            raise AddressError(
                f"{scheme}:// is no scheme that an installed library serves",
                allowed=FORMS,
                remedy="Correct the scheme, or install the fsspec library that serves it",
            )
        path = path.rstrip("/")
        if scheme in EXTRAS and "?" in path:
            raise AddressError(f"{scheme}:// takes no question mark", allowed=(EXTRAS[scheme][2],))
        if scheme == "hf" and not _HUB.fullmatch(path):
            raise AddressError(f"{text!r} names no data set of the Hub", allowed=(EXTRAS["hf"][2],))
        if not path or ".." in path.split("/"):
            raise AddressError(f"{text!r} names no folder", allowed=FORMS)
        return cls(scheme, path)

    @property
    def hub(self) -> tuple[str, str | None, str]:
        """Of ``hf://``: repository, revision (None for the main branch), folder in it ("" for all of it)."""
        match = _HUB.fullmatch(self.path)
        assert match is not None
        return match["repo"], match["revision"], match["folder"] or ""

    @property
    def missing(self) -> tuple[str, str]:
        """Library that is not installed, and the extra that brings it; "" if all is there."""
        module, extra, _ = EXTRAS.get(self.scheme, ("fsspec", "cloud", ""))
        needed = (module,) if extra == "hf" else (module, "fsspec")
        return ("", "") if all(find_spec(name) for name in needed) else (module, extra)


def _others() -> Iterator[str]:
    """Schemes of fsspec itself, and of the libraries that registered theirs."""
    for entry in entry_points(group="fsspec.specs"):
        yield entry.name
    if find_spec("fsspec") is not None:
        from fsspec.registry import known_implementations

        yield from known_implementations


def holds_secret(text: str) -> bool:
    """Whether an address has a password, a token, or a parameter that is named like one."""
    if _USER.search(text) or _TOKENS.search(text):
        return True
    first, _, _ = text.partition("://")[2].partition("/")
    if "@" in first and text.lower().startswith(("s3://", "s3a://", "gs://", "gcs://", "http")):
        return True
    return bool(re.search(r"[?&][^=\s]*(token|secret|password|key|sig)[^=\s]*=", text, re.IGNORECASE))


def redacted(text: str, environment: Mapping[str, str] | None = None) -> str:
    """A text without passwords, tokens, parameters of addresses, and values of secret variables."""
    for name, value in (os.environ if environment is None else environment).items():
        if len(value) >= 8 and _SECRET_NAME.search(name) and not value.startswith("/"):
            text = text.replace(value, HIDDEN)
    text = _TOKENS.sub(HIDDEN, _USER.sub(HIDDEN, text))
    return _BEARER.sub(rf"\1 {HIDDEN}", _QUERY.sub(r"\1", text))
