"""Addresses of remote data sets, and the removal of their secrets from texts.

Settings import this module during validation, so it does not import the library of any remote.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import entry_points
from importlib.util import find_spec

from joshua.api.texts import has_token, masked

#: Schemes with an extra of this distribution: module, extra, form of an address.
EXTRAS = {
    "hf": ("huggingface_hub", "hf", "hf://datasets/NAME/DATA"),
    "s3": ("s3fs", "s3", "s3://BUCKET/FOLDER"),
    "gs": ("gcsfs", "gs", "gs://BUCKET/FOLDER"),
}

#: Aliases of these schemes.
ALIASES = {"gcs": "gs", "s3a": "s3"}

FORMS = tuple(form for _, _, form in EXTRAS.values())

_HUB = re.compile(
    r"datasets/(?P<repo>[\w.-]+/[\w.-]+)(?:@(?P<revision>[\w.~%-]+))?(?:/(?P<folder>.+))?", re.ASCII
)

#: Query of an address, which can contain a signature of any name.
_QUERY = re.compile(r"(\b[a-z][a-z0-9+.-]*://[^\s?'\"]+)\?[^\s'\"]+", re.IGNORECASE)


class AddressError(ValueError):
    """An address cannot be used.

    Attributes:
        allowed: forms that can be used; remedy: what to do.
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
        """Parse an address. Raises AddressError, whose text contains no secret."""
        if holds_secret(text):
            raise AddressError(
                "the address contains a password or a token",
                remedy="Remove it. Credentials come from the environment (HF_TOKEN, AWS_ACCESS_KEY_ID, "
                "GOOGLE_APPLICATION_CREDENTIALS) or from the configuration files of the remote's own tool",
            )
        scheme, colon, path = text.strip().partition("://")
        scheme = ALIASES.get(scheme.lower(), scheme.lower())
        if not colon:
            raise AddressError(f"{text!r} is not an address: it has no scheme such as s3://", allowed=FORMS)
        if scheme not in EXTRAS and scheme not in _others():
            raise AddressError(
                f"{scheme}:// is a scheme that no installed library supports",
                allowed=FORMS,
                remedy="Correct the scheme, or install the fsspec library that supports it",
            )
        path = path.rstrip("/")
        if scheme in EXTRAS and "?" in path:
            raise AddressError(
                f"{scheme}:// addresses cannot contain a question mark", allowed=(EXTRAS[scheme][2],)
            )
        if scheme == "hf" and not _HUB.fullmatch(path):
            raise AddressError(f"{text!r} does not name a data set on the Hub", allowed=(EXTRAS["hf"][2],))
        if not path or ".." in path.split("/"):
            raise AddressError(f"{text!r} does not name a folder", allowed=FORMS)
        return cls(scheme, path)

    @property
    def hub(self) -> tuple[str, str | None, str]:
        """Return repository, revision (None for the main branch) and folder ("" for all) of ``hf://``."""
        match = _HUB.fullmatch(self.path)
        assert match is not None
        return match["repo"], match["revision"], match["folder"] or ""

    @property
    def missing(self) -> tuple[str, str]:
        """Return the missing library and the extra that installs it; "" if nothing is missing."""
        module, extra, _ = EXTRAS.get(self.scheme, ("fsspec", "cloud", ""))
        needed = (module,) if extra == "hf" else (module, "fsspec")
        return ("", "") if all(find_spec(name) for name in needed) else (module, extra)


def _others() -> Iterator[str]:
    """Yield the schemes of fsspec itself and of the libraries registered with it."""
    for entry in entry_points(group="fsspec.specs"):
        yield entry.name
    if find_spec("fsspec") is not None:
        from fsspec.registry import known_implementations

        yield from known_implementations


def holds_secret(text: str) -> bool:
    """Return whether an address contains a password, a token, or a parameter named like one."""
    if has_token(text):
        return True
    first, _, _ = text.partition("://")[2].partition("/")
    if "@" in first and text.lower().startswith(("s3://", "s3a://", "gs://", "gcs://", "http")):
        return True
    return bool(re.search(r"[?&][^=\s]*(token|secret|password|key|sig)[^=\s]*=", text, re.IGNORECASE))


def redacted(text: str) -> str:
    """Remove secrets and the queries of addresses from a text of a remote's library."""
    return _QUERY.sub(r"\1", masked(text))
