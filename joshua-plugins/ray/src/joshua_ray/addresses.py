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


def refuse_other_tls(address: str, environment: Mapping[str, str], limit_s: float = 3.0) -> None:
    """Refuse a cluster that has TLS other than this process; Ray would try to connect for a minute.

    Raises:
        JobError: only one of both has TLS, or the authority did not sign the certificate of the cluster.
        OSError: nothing answers.
    """
    import socket
    import ssl

    host, port = parsed(address)
    has_tls = environment.get("RAY_USE_TLS", "0") == "1"
    context = ssl.create_default_context() if has_tls else ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.set_alpn_protocols(["h2"])
    if has_tls:
        certificate, key, authority = (environment.get(name) or "" for name in TLS_FILES)
        try:
            context.load_verify_locations(authority)
            context.load_cert_chain(certificate, key)
        except OSError as error:
            raise JobError(
                f"the files of TLS cannot be used: {error}. Correct {', '.join(TLS_FILES)}"
            ) from error
    else:
        context.verify_mode = ssl.CERT_NONE
    with socket.create_connection((host, port), limit_s) as connection:
        try:
            context.wrap_socket(connection, server_hostname=host).close()
        except ssl.SSLCertVerificationError as error:
            raise JobError(
                f"the Ray cluster at {address} has a certificate that RAY_TLS_CA_CERT did not sign "
                f"({error.verify_message}). Name the certificate of the cluster's authority"
            ) from error
        except OSError as error:
            if has_tls:
                raise JobError(
                    f"the Ray cluster at {address} has no TLS, but RAY_USE_TLS=1 is set. Start its nodes "
                    "with RAY_USE_TLS=1 and their certificates, or unset it"
                ) from error
            return
    if not has_tls:
        raise JobError(
            f"the Ray cluster at {address} has TLS, and this process does not. Set RAY_USE_TLS=1 and "
            f"{', '.join(TLS_FILES)}"
        )
