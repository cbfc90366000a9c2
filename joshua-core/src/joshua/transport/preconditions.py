"""What a transport needs of this machine, looked at before the middleware is: it says less, or aborts."""

from __future__ import annotations

import ipaddress
import os
import socket
from pathlib import Path

from joshua.plan import TransportSpec
from joshua.transport.errors import TransportError

_FILE_URI = "file://"


def require_usable(spec: TransportSpec) -> None:
    """Checks certificates, interface, peers and settings files of a transport.

    Raises:
        TransportError: names the one that cannot be used, why, and what to do.
    """
    if spec.kind == "zenoh":
        _require_certificates(spec)
        return
    _require_interface(spec.network_interface)
    for peer in spec.peers:
        _require_host(peer)
    for part in os.environ.get("CYCLONEDDS_URI", "").split(","):
        path = part.strip().removeprefix(_FILE_URI)
        if part.strip().startswith(_FILE_URI) and not Path(path).is_file():
            raise TransportError(f"CYCLONEDDS_URI names {path}, which is no file: correct or unset it")


def _require_certificates(spec: TransportSpec) -> None:
    if spec.tls is None:
        return
    import ssl

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    tls = spec.tls
    _require_readable("root_ca_file", tls.root_ca_file)
    _require_readable("certificate_file", tls.certificate_file)
    _require_readable("private_key_file", tls.private_key_file)
    try:
        context.load_verify_locations(tls.root_ca_file)
    except ssl.SSLError as error:
        raise TransportError(
            f"root_ca_file: {tls.root_ca_file} holds no certificate in PEM form ({_reason(error)}): give the "
            "certificate of the authority that signed those of the robot"
        ) from error
    try:
        context.load_cert_chain(tls.certificate_file, tls.private_key_file, password=_no_password)
    except ssl.SSLError as error:
        raise TransportError(
            f"certificate_file and private_key_file: {tls.certificate_file} and {tls.private_key_file} are "
            f"no certificate and its key in PEM form ({_reason(error)}): give a certificate and the key that "
            "it was made for"
        ) from error
    except _EncryptedKeyError as error:
        raise TransportError(
            f"private_key_file: {tls.private_key_file} is protected by a password: give a key without one, "
            "readable by you alone"
        ) from error


class _EncryptedKeyError(Exception):
    pass


def _no_password() -> str:
    raise _EncryptedKeyError


def _require_readable(field: str, path: str) -> None:
    try:
        with Path(path).open("rb"):
            pass
    except OSError as error:
        raise TransportError(f"{field}: {path} cannot be read: {error.strerror}") from error


def _reason(error: Exception) -> str:
    text = str(getattr(error, "reason", "") or error).lower().replace("_", " ")
    return (
        "no PEM text in it" if text in ("no start line", "pem lib", "no certificate or crl found") else text
    )


def _require_interface(name: str) -> None:
    if not name:
        return
    names = [interface for _, interface in socket.if_nameindex()]
    if name in names:
        return
    try:
        ipaddress.ip_address(name)
    except ValueError:
        raise TransportError(
            f"network_interface: this machine has no interface {name!r}; it has {', '.join(names)}"
        ) from None


def _require_host(peer: str) -> None:
    with_port = peer.count(":") == 1 or "]:" in peer
    host = (peer.rpartition(":")[0] if with_port else peer).strip("[]")
    try:
        socket.getaddrinfo(host, None)
    except UnicodeError as error:
        raise TransportError(
            f"peers: {host!r} is no name or address of a host: write an address such as 192.168.1.20"
        ) from error
    except OSError as error:
        raise TransportError(
            f"peers: the host {host!r} is not known here ({error.strerror}): write its address, or add its "
            "name to /etc/hosts"
        ) from error
