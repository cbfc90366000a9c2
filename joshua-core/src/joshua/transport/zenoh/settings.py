"""Zenoh configurations of sessions and routers, made from the transport settings."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import zenoh

from joshua.plan import TransportSettings
from joshua.transport.transports import TransportError
from joshua.transport.zenoh.endpoints import Endpoint, read_endpoint
from joshua.transport.zenoh.meeting import own_socket, router_socket, unix_endpoint

_log = logging.getLogger("joshua.transport")

# The router responds within milliseconds. This only bounds the wait if none runs.
_OPEN_WAIT_MS = 200
_ANSWER_MS = 1000
# A replaced router is found again well within a second.
_RETRY = {"period_init_ms": 50, "period_max_ms": 400, "period_increase_factor": 2}

_ALONE: dict[str, Any] = {
    "listen/endpoints": [],
    "connect/endpoints": [],
    "scouting/gossip/enabled": False,
    "scouting/delay": 0,
}

#: A session with these settings has no other sockets than UNIX sockets.
_PRIVATE: dict[str, Any] = {"transport/link/protocols": ["unixsock-stream"]}

# `**` matches no part that begins with @, so these are named: of ROS 2, of JOSHUA's nodes, of caches for late
# joiners, and of Zenoh itself.
_KEYS = ("**", "@ros2_lv/**", "@joshua_node/**", "@joshua_alive/**", "**/@adv/**", "@/**")
_WATCH_ONLY: dict[str, Any] = {
    "enabled": True,
    "default_permission": "allow",
    "rules": [
        {
            "id": "no-commands",
            "permission": "deny",
            "flows": ["ingress"],
            "messages": ["put", "delete", "declare_queryable", "reply", "liveliness_token"],
            "key_exprs": list(_KEYS),
        },
        {
            # a late subscriber asks the cache of a publisher, which changes nothing
            "id": "no-calls",
            "permission": "deny",
            "flows": ["ingress"],
            "messages": ["query"],
            "key_exprs": [key for key in _KEYS if "@adv" not in key],
        },
    ],
    "subjects": [{"id": "without-user", "link_protocols": ["tcp", "udp", "ws"]}],
    "policies": [{"rules": ["no-commands", "no-calls"], "subjects": ["without-user"]}],
}

_lock = threading.Lock()
_open_here = 0
_inherited = False


def _after_fork() -> None:
    global _inherited, _open_here, _lock
    _lock = threading.Lock()
    _inherited = _inherited or _open_here > 0
    _open_here = 0


os.register_at_fork(after_in_child=_after_fork)


def _count_session(change: int) -> None:
    global _open_here
    with _lock:
        _open_here += change


def router_endpoints(settings: TransportSettings) -> list[Endpoint]:
    """Endpoints of this machine's router.

    Raises:
        TransportError: an endpoint is malformed, or encrypted without certificates, or open to the
            network beside encrypted ones.
    """
    endpoints = [read_endpoint(text) for text in settings.listen_endpoints]
    if not endpoints:
        raise TransportError("the Zenoh router has no endpoint. Add one, such as tcp/localhost:7447")
    for endpoint in endpoints:
        if endpoint.encrypted and settings.tls is None:
            raise TransportError(
                f"the endpoint {endpoint} requires certificates. Set the tls block of the transport, or "
                "listen on tcp/localhost:7447"
            )
        if settings.tls is not None and not endpoint.encrypted:
            raise TransportError(
                f"the endpoint {endpoint} would accept clients without a certificate. With a tls block "
                f"write tls/{endpoint.host}:{endpoint.port}, or remove the tls block"
            )
    return endpoints


def own_router(settings: TransportSettings) -> Endpoint:
    """Endpoint of the router for this machine's nodes: loopback if it listens there.

    Raises:
        TransportError: as ``router_endpoints``.
    """
    endpoints = [endpoint.local for endpoint in router_endpoints(settings)]
    return next((endpoint for endpoint in endpoints if endpoint.loopback), endpoints[0])


def node_config(settings: TransportSettings) -> zenoh.Config:
    """Configuration of a session of a run: a peer in the run's folder, without any TCP socket.

    Links between nodes are direct. A session that could use TCP would be reachable for other users.

    Raises:
        TransportError: as ``router_endpoints``.
    """
    if settings.discovery_range == "OFF":
        return _config({"mode": "peer"} | _ALONE)
    folder = settings.link_folder
    values = {
        "mode": "peer",
        "listen/endpoints": [unix_endpoint(own_socket(folder))],
        "connect/endpoints": [unix_endpoint(router_socket(folder))],
        "scouting/delay": _OPEN_WAIT_MS,
        # every node reaches all others, so one side of each pair connects
        "scouting/gossip/target": {"router": ["router", "peer"], "peer": ["router"]},
        "scouting/gossip/autoconnect_strategy": {"peer": {"to_router": "always", "to_peer": "greater-zid"}},
    }
    return _config(values | _PRIVATE)


def client_config(settings: TransportSettings, endpoint: str) -> zenoh.Config:
    """Configuration of a session outside a run: a client of the router.

    Raises:
        TransportError: as ``router_endpoints``.
    """
    own = {"mode": "client", "connect/endpoints": [endpoint], "transport/unicast/open_timeout": _ANSWER_MS}
    return _config(_certificates(settings) | _ALONE | own)


def waiting_config(settings: TransportSettings) -> zenoh.Config:
    """Configuration of a session outside a run that waits for a router, which a client cannot.

    Raises:
        TransportError: as ``router_endpoints``.
    """
    own = {"mode": "router", "connect/endpoints": [str(own_router(settings))]}
    return _config(_certificates(settings) | _ALONE | own)


def run_router_config(folder: str, meeting: Sequence[Path]) -> zenoh.Config:
    """Configuration of a run's own router, which links its nodes to the router of the machine.

    Args:
        folder: of the run; meeting: sockets at which the machine's router may be.
    """
    own = {
        "mode": "router",
        "listen/endpoints": [unix_endpoint(router_socket(folder))],
        "connect/endpoints": [unix_endpoint(path) for path in meeting],
        "scouting/delay": 0,
    }
    return _config(own | _PRIVATE)


def router_config(
    settings: TransportSettings,
    meeting: Path,
    listen: Sequence[str],
    connect: Sequence[str],
    *,
    watched: bool,
) -> zenoh.Config:
    """Configuration of the router of this machine.

    Args:
        settings: for the certificates.
        meeting: UNIX socket for this user's sessions.
        listen: further endpoints; connect: other routers.
        watched: whether links that carry no user may only watch.

    Raises:
        TransportError: as ``router_endpoints``.
    """
    own = {
        "mode": "router",
        "listen/endpoints": [unix_endpoint(meeting), *listen],
        "connect/endpoints": list(connect),
        "scouting/delay": 0,
    }
    return _config(_certificates(settings) | own | ({"access_control": _WATCH_ONLY} if watched else {}))


def _config(values: dict[str, Any]) -> zenoh.Config:
    common: dict[str, Any] = {
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": True,
        "connect/exit_on_failure": False,
        "connect/retry": _RETRY,
        # caches for late joiners need time stamps
        "timestamping/enabled": True,
    }
    config = zenoh.Config()
    for key, value in (common | values).items():
        config.insert_json5(key, json.dumps(value))
    return config


def _certificates(settings: TransportSettings) -> dict[str, Any]:
    tls = settings.tls
    if tls is None:
        return {}
    return {
        "transport/link/tls": {
            "root_ca_certificate": tls.root_ca_file,
            "listen_certificate": tls.certificate_file,
            "listen_private_key": tls.private_key_file,
            "connect_certificate": tls.certificate_file,
            "connect_private_key": tls.private_key_file,
            "enable_mtls": True,
            # the authority decides which machines are trusted, so certificates need not name each address
            "verify_name_on_connect": False,
        }
    }


def open_session(config: zenoh.Config, *, warn: bool = True) -> Any:
    """Open a session, to be closed with ``close_session``. Without shared memory, it uses sockets.

    Args:
        config: of the session.
        warn: whether missing shared memory is logged as a warning; one process of a run is enough.

    Raises:
        TransportError: Zenoh refuses the settings, or this process was forked from one with an open session.
    """
    if _inherited:
        raise TransportError(
            "this process was forked from one with an open Zenoh session, in which Zenoh hangs. Fork before "
            "you open the transport, or start the process with spawn"
        )
    _count_session(1)
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        # without the position in Zenoh's sources
        reason = str(error).split(" at /", 1)[0].rstrip(". ")
        if "shm" in reason:
            with contextlib.suppress(zenoh.ZError):
                return _open_without_shared_memory(config, reason, logging.WARNING if warn else logging.DEBUG)
        _count_session(-1)
        raise TransportError(reason) from error


def _open_without_shared_memory(config: zenoh.Config, reason: str, level: int) -> Any:
    config.insert_json5("transport/shared_memory/enabled", "false")
    session = zenoh.open(config)
    _log.log(
        level,
        "no shared memory (%s): messages use sockets, which triples the latency of large images. Check that "
        "/dev/shm exists, is writable and has free space: df -h /dev/shm",
        reason,
    )
    return session


def close_session(session: Any) -> None:
    """Close a session."""
    session.close()
    _count_session(-1)


def require_certificates(settings: TransportSettings) -> None:
    """Check the certificates of a transport, because Zenoh's errors are less specific, or it aborts.

    Raises:
        TransportError: names the file that cannot be used, why, and what to do.
    """
    tls = settings.tls
    if tls is None:
        return
    import ssl

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    for field in ("root_ca_file", "certificate_file", "private_key_file"):
        path = Path(getattr(tls, field))
        try:
            path.open("rb").close()
        except OSError as error:
            raise TransportError(f"{field}: {path} cannot be read: {error.strerror}") from error
    try:
        context.load_verify_locations(tls.root_ca_file)
    except ssl.SSLError as error:
        raise TransportError(
            f"root_ca_file: {tls.root_ca_file} holds no certificate in PEM form ({_reason(error)}). Name the "
            "certificate of the authority that signed those of the robot"
        ) from error
    try:
        context.load_cert_chain(tls.certificate_file, tls.private_key_file, password=_no_password)
    except ssl.SSLError as error:
        raise TransportError(
            f"certificate_file and private_key_file: {tls.certificate_file} and {tls.private_key_file} are "
            f"no certificate and its key in PEM form ({_reason(error)}). Name a certificate and the key that "
            "belongs to it"
        ) from error
    except _EncryptedKeyError as error:
        raise TransportError(
            f"private_key_file: {tls.private_key_file} is protected by a password. Use a key without one "
            "that only you can read"
        ) from error


class _EncryptedKeyError(Exception):
    pass


def _no_password() -> str:
    raise _EncryptedKeyError


def _reason(error: Exception) -> str:
    text = str(getattr(error, "reason", "") or error).lower().replace("_", " ")
    return (
        "no PEM text in it" if text in ("no start line", "pem lib", "no certificate or crl found") else text
    )
