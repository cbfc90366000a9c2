"""Zenoh configurations of a node's session and of a router, made from the transport specification."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import threading
from typing import Any

import zenoh

from joshua.plan import TransportSpec
from joshua.transport.endpoints import Endpoint, read_endpoint
from joshua.transport.errors import TransportError

_lock = threading.Lock()
_open_here = 0
_inherited = False


def session_opened() -> None:
    """Counts a session that is about to be opened.

    Raises:
        TransportError: this process was forked from one that had a session open.
    """
    global _open_here
    if _inherited:
        raise TransportError(
            "this process was forked from one with an open Zenoh session, in which the middleware hangs; "
            "fork first and open the transport afterwards, or start the process anew (spawn)"
        )
    with _lock:
        _open_here += 1


def session_closed() -> None:
    """Counts a session that was closed."""
    global _open_here
    with _lock:
        _open_here -= 1


def _after_fork() -> None:
    global _inherited, _open_here, _lock
    _lock = threading.Lock()
    _inherited = _inherited or _open_here > 0
    _open_here = 0


os.register_at_fork(after_in_child=_after_fork)


_log = logging.getLogger("joshua.transport")

# The router answers within milliseconds; this only bounds the wait where none runs.
_OPEN_WAIT_MS = 200
_ANSWER_MS = 1000
# A router that was replaced is found again well within a second.
_RETRY = {"period_init_ms": 50, "period_max_ms": 400, "period_increase_factor": 2}

_ALONE: dict[str, Any] = {
    "listen/endpoints": [],
    "connect/endpoints": [],
    "scouting/gossip/enabled": False,
    "scouting/delay": 0,
}


def router_endpoints(spec: TransportSpec) -> list[Endpoint]:
    """Where the router of this machine listens.

    Raises:
        TransportError: an endpoint is malformed, or encrypted without certificates, or open to the
            network beside encrypted ones.
    """
    endpoints = [read_endpoint(text) for text in spec.listen_endpoints]
    if not endpoints:
        raise TransportError("no endpoint for the Zenoh router; give one, such as tcp/localhost:7447")
    for endpoint in endpoints:
        if endpoint.encrypted and spec.tls is None:
            raise TransportError(
                f"the endpoint {endpoint} needs certificates; set the tls block of the transport, or "
                "listen on tcp/localhost:7447"
            )
        if spec.tls is not None and not endpoint.encrypted:
            raise TransportError(
                f"the endpoint {endpoint} would let clients without a certificate in; with a tls block "
                f"write tls/{endpoint.host}:{endpoint.port}, or drop the tls block"
            )
    return endpoints


def own_router(spec: TransportSpec) -> Endpoint:
    """How the nodes of this machine reach their router: by loopback where it listens there.

    Raises:
        TransportError: as ``router_endpoints``.
    """
    endpoints = [endpoint.local for endpoint in router_endpoints(spec)]
    return next((endpoint for endpoint in endpoints if endpoint.loopback), endpoints[0])


def session_config(spec: TransportSpec) -> zenoh.Config:
    """Configuration of a node's session: a peer that finds the others through the router.

    Raises:
        TransportError: as ``router_endpoints``.
    """
    protocol = "tcp" if spec.tls is None else "tls"
    values = _common(spec)
    values.update(
        {
            "mode": "peer",
            "listen/endpoints": [f"{protocol}/localhost:0"],
            "connect/endpoints": [str(own_router(spec))],
            "connect/exit_on_failure": False,
            "connect/retry": _RETRY,
            "scouting/delay": _OPEN_WAIT_MS,
            # every peer reaches every other one, so that one side of each pair connects
            "scouting/gossip/target": {"router": ["router", "peer"], "peer": ["router"]},
            "scouting/gossip/autoconnect_strategy": {
                "peer": {"to_router": "always", "to_peer": "greater-zid"}
            },
        }
    )
    if spec.discovery_range == "OFF":
        values.update(_ALONE)
    return _config(values)


def guest_config(spec: TransportSpec) -> zenoh.Config:
    """Configuration of a session that only watches the router of this machine: it links to nothing else.

    Raises:
        TransportError: as ``router_endpoints``.
    """
    values = _common(spec)
    values.update(_ALONE)
    values.update(
        {
            "mode": "peer",
            "connect/endpoints": [str(own_router(spec))],
            "connect/exit_on_failure": False,
            "connect/retry": _RETRY,
            # what holds the port may be no router and never answer
            "transport/unicast/open_timeout": _ANSWER_MS,
        }
    )
    return _config(values)


def router_config(spec: TransportSpec) -> zenoh.Config:
    """Configuration of the router of this machine.

    Raises:
        TransportError: as ``router_endpoints``, or a connect endpoint is malformed.
    """
    values = _common(spec)
    values.update(
        {
            "mode": "router",
            "listen/endpoints": [str(endpoint) for endpoint in router_endpoints(spec)],
            "connect/endpoints": [str(read_endpoint(text)) for text in spec.connect_endpoints],
            "connect/exit_on_failure": False,
            "connect/retry": _RETRY,
            "scouting/delay": 0,
        }
    )
    return _config(values)


def _common(spec: TransportSpec) -> dict[str, Any]:
    values: dict[str, Any] = {
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": True,
        # caches for late joiners need time stamps
        "timestamping/enabled": True,
    }
    if spec.tls is not None:
        values["transport/link/tls"] = {
            "root_ca_certificate": spec.tls.root_ca_file,
            "listen_certificate": spec.tls.certificate_file,
            "listen_private_key": spec.tls.private_key_file,
            "connect_certificate": spec.tls.certificate_file,
            "connect_private_key": spec.tls.private_key_file,
            "enable_mtls": True,
            # the authority decides who belongs to the robot; its certificates need not name each address
            "verify_name_on_connect": False,
        }
    return values


def open_session(config: zenoh.Config, *, warn: bool = True) -> Any:
    """Opens a session; close it with ``close_session``.

    Where the system offers no shared memory, the session goes without.

    Args:
        config: of the session.
        warn: whether a lack of shared memory is worth a warning; one process of a run is enough.

    Raises:
        TransportError: Zenoh refuses the settings, or this process was forked from one with an open session.
    """
    session_opened()
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        reason = _reason(error)
        if "shm" in reason:
            with contextlib.suppress(zenoh.ZError):
                return _open_without_shared_memory(config, reason, logging.WARNING if warn else logging.DEBUG)
        session_closed()
        raise TransportError(reason) from error


def _open_without_shared_memory(config: zenoh.Config, reason: str, level: int) -> Any:
    config.insert_json5("transport/shared_memory/enabled", "false")
    session = zenoh.open(config)
    _log.log(
        level,
        "no shared memory (%s): messages go through sockets, which costs large images about three times the "
        "latency. See whether /dev/shm is there, writable and has room: df -h /dev/shm",
        reason,
    )
    return session


def _reason(error: zenoh.ZError) -> str:
    """What Zenoh said, without the place in its own sources."""
    return str(error).split(" at /", 1)[0].rstrip(". ")


def close_session(session: Any) -> None:
    """Closes a session."""
    session.close()
    session_closed()


def _config(values: dict[str, Any]) -> zenoh.Config:
    config = zenoh.Config()
    for key, value in values.items():
        config.insert_json5(key, json.dumps(value))
    return config
