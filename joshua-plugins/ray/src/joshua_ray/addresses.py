"""Which clusters may be used: on the loopback, or with token authentication and TLS.

Ray runs what its messages contain (cloudpickle). Whoever can reach a cluster can run code on it.
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Mapping
from pathlib import Path

from joshua_jobs.executor import JobError

#: Starts a cluster of this machine alone.
LOCAL = "local"

_INVALID = 2

#: Files of TLS, by Ray's variables.
TLS_FILES = ("RAY_TLS_SERVER_CERT", "RAY_TLS_SERVER_KEY", "RAY_TLS_CA_CERT")

_ADDRESS = re.compile(r"(?:\[(?P<six>[0-9a-fA-F:.]+)\]|(?P<name>[A-Za-z0-9._-]+)):(?P<port>[0-9]{1,5})")


def parsed(address: str) -> tuple[str, int]:
    """Return host and port of an address other than ``local``. Raises JobError."""
    if "://" in address:
        raise JobError(
            f"--ray {address}: Ray's client protocol is not supported. Make this machine a node of "
            "the cluster (ray start --address=HOST:PORT), and write --ray HOST:PORT",
            _INVALID,
        )
    match = _ADDRESS.fullmatch(address)
    port = int(match["port"]) if match else 0
    if match is None or not 0 < port < 65536:
        raise JobError(
            f"--ray {address}: not an address. Write HOST:PORT of the head, such as 127.0.0.1:6379, or local",
            _INVALID,
        )
    return match["six"] or match["name"], port


def is_loopback(host: str) -> bool:
    """Return whether a host is this machine only. A name other than localhost is not resolved."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def check(address: str, environment: Mapping[str, str]) -> None:
    """Refuse an address that is malformed, or off the loopback without authentication and TLS.

    Raises:
        JobError: with exit code 2.
    """
    if address == LOCAL:
        return
    host, _ = parsed(address)
    if not is_loopback(host):
        refuse_unprotected(f"--ray {address}", environment)


def refuse_unprotected(what: str, environment: Mapping[str, str]) -> None:
    """Refuse what is off the loopback unless authentication and TLS are configured. Raises JobError."""
    lacking = []
    if environment.get("RAY_AUTH_MODE", "").lower() != "token":
        lacking.append("RAY_AUTH_MODE=token")
    if not _has_token(environment):
        lacking.append("a token (RAY_AUTH_TOKEN_PATH, or `ray get-auth-token --generate`)")
    if environment.get("RAY_USE_TLS", "0") != "1":
        lacking.append("RAY_USE_TLS=1")
    lacking += [
        f"{name} (a file)"
        for name in TLS_FILES
        if not environment.get(name) or not Path(environment[name]).is_file()
    ]
    if lacking:
        raise JobError(
            f"{what} is not on the loopback, and whoever reaches a Ray cluster can run code on it. It "
            f"requires token authentication and TLS; missing: {', '.join(lacking)}. Set them alike on "
            "every node, see the guide “Beyond one machine”",
            _INVALID,
        )


def _has_token(environment: Mapping[str, str]) -> bool:
    if environment.get("RAY_AUTH_TOKEN"):
        return True
    named = environment.get("RAY_AUTH_TOKEN_PATH")
    path = Path(named) if named else Path(environment.get("HOME") or "~").expanduser() / ".ray" / "auth_token"
    try:
        return bool(path.read_text(encoding="utf-8").strip())
    except (OSError, UnicodeDecodeError):
        return False
