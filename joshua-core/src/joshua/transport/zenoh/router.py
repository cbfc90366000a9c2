"""The Zenoh router of this machine: hosted here unless one runs already, and replaced if it dies."""

from __future__ import annotations

import errno
import logging
import socket
import threading
import time
from collections.abc import Sequence
from typing import Any

from joshua.plan import TransportSettings
from joshua.transport.transports import TransportError
from joshua.transport.zenoh.endpoints import read_endpoint
from joshua.transport.zenoh.settings import (
    close_session,
    guest_config,
    open_session,
    own_router,
    require_certificates,
    router_config,
    router_endpoints,
)

_log = logging.getLogger("joshua.transport")
_LINK_LOOK_S = 0.5
_NAMES_HOLD_S = 10.0
#: A router responds within milliseconds, over a network somewhat later.
_PATIENCE_S = 3.0
#: Time limit for a response of the router on the port, whose process may be stalled.
_ANSWER_S = 5.0
_LOOK_S = 0.2
_POLL_S = 0.02
_IN_USE = f"os error {errno.EADDRINUSE}"
_REMEDIES = {
    f"os error {errno.EADDRNOTAVAIL}": (
        "no interface of this machine has that address. Use localhost, 0.0.0.0 for every interface, or an "
        "address that `ip address` lists"
    ),
    f"os error {errno.EACCES}": (
        "only the administrator can use ports below 1024. Choose a higher port, such as 7447"
    ),
    "failed to lookup address": "the host name is unknown. Use localhost, or an address of this machine",
}


class FarRouters:
    """Logs the state of a router's links to ``connect_endpoints``; Zenoh itself retries.

    Args:
        session: the Zenoh session of the router.
        endpoints: such as ``tcp/robot.local:7447``.
    """

    def __init__(self, session: Any, endpoints: Sequence[str], *, patience_s: float = _PATIENCE_S) -> None:
        self._session = session
        self._patience_s = patience_s
        self._linked: dict[str, bool | None] = dict.fromkeys(endpoints)
        self._found: dict[str, tuple[float, set[str], str]] = {}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="joshua-far-routers", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop watching."""
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        waited_s = 0.0
        while not self._stop.wait(_LINK_LOOK_S):
            waited_s += _LINK_LOOK_S
            reached = {link.dst for link in self._session.info.links()}
            for endpoint, before in self._linked.items():
                addresses, reason = self._addresses(endpoint)
                linked = bool(addresses & reached)
                if linked is not before and (linked or waited_s >= self._patience_s):
                    self._linked[endpoint] = linked
                    _say(endpoint, linked, before, reason)

    def _addresses(self, endpoint: str) -> tuple[set[str], str]:
        """The addresses of an endpoint, cached because name resolution may use a network."""
        now_s = time.monotonic()
        until_s, addresses, reason = self._found.get(endpoint, (now_s, set(), ""))
        if now_s >= until_s:
            addresses, reason = _look_up(endpoint)
            self._found[endpoint] = (now_s + _NAMES_HOLD_S, addresses, reason)
        return addresses, reason


def _say(endpoint: str, linked: bool, before: bool | None, reason: str) -> None:
    if linked:
        _log.info("linked to the router on %s", endpoint)
    elif before:
        _log.warning("lost the link to the router on %s, retrying", endpoint)
    else:
        _log.warning(
            "connect_endpoints: no router answers on %s%s, retrying. Check that JOSHUA or a router runs "
            "there and that no firewall blocks the port",
            endpoint,
            f" ({reason})" if reason else "",
        )


def _look_up(endpoint: str) -> tuple[set[str], str]:
    """Names of the links to an endpoint, or why its host has no address."""
    parsed = read_endpoint(endpoint)
    try:
        found = socket.getaddrinfo(parsed.host, parsed.port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):  # the latter where it cannot be a name
        return set(), f"the host name {parsed.host} cannot be resolved"
    hosts = [str(entry[4][0]) for entry in found]
    return {f"{parsed.protocol}/{f'[{host}]' if ':' in host else host}:{parsed.port}" for host in hosts}, ""


class RouterHandle:
    """Hosts the router of the machine, or watches the process that hosts it.

    If a watched router dies, a thread hosts a new one on the same endpoints. Several processes may watch; the
    port decides which one succeeds. Never create one before a fork.

    Attributes:
        endpoints: of the router.
    """

    def __init__(self, settings: TransportSettings) -> None:
        self._settings = settings
        self.endpoints = tuple(str(endpoint) for endpoint in router_endpoints(settings))
        self._reach = str(own_router(settings))
        self._router: Any = None
        self._guest: Any = None
        self._far: FarRouters | None = None
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._keeper: threading.Thread | None = None

    @property
    def hosting(self) -> bool:
        """Whether this process hosts the router."""
        return self._router is not None

    @property
    def description(self) -> str:
        """Description for the start-up table."""
        where = ", ".join(self.endpoints)
        if self.hosting:
            return f"hosts the Zenoh router on {where}"
        joined = f"joined the Zenoh router on {self._reach}"
        if self._settings.connect_endpoints:
            joined += (
                ", which another program hosts: connect_endpoints of this file have no effect while it runs"
            )
        return joined

    def start(self) -> None:
        """Host the router, or join a running one.

        Raises:
            TransportError: the endpoints cannot be used, or a program that is no router uses them.
        """
        refusal = self._host()
        if self.hosting:
            return
        if _IN_USE not in refusal:
            raise TransportError(self._cannot_listen(refusal))
        self._join()
        if not self._router_answers():
            self.close()
            raise TransportError(
                f"another program uses {', '.join(self.endpoints)} and does not answer as a Zenoh router"
                f"{' with these certificates' if self._settings.tls else ''}, so this run can neither listen "
                "nor join one there. Stop that program (`ss -ltnp` lists it), or set other "
                "listen_endpoints in the transport block"
            )
        if self._guest is not None:
            self._keeper = threading.Thread(target=self._keep, name="joshua-router-keeper", daemon=True)
            self._keeper.start()

    def close(self) -> None:
        """Stop hosting or watching. Idempotent."""
        self._stop.set()
        if self._keeper is not None and threading.current_thread() is not self._keeper:
            self._keeper.join()
        if self._far is not None:
            self._far.close()
            self._far = None
        with self._lock:
            for session in (self._guest, self._router):
                if session is not None:
                    close_session(session)
            self._guest = self._router = None

    def _host(self) -> str:
        """Try to host. Return why it failed."""
        try:
            router = open_session(router_config(self._settings))
        except TransportError as error:
            return str(error)
        with self._lock:
            self._router = router
            if self._settings.connect_endpoints:
                self._far = FarRouters(router, self._settings.connect_endpoints)
        return ""

    def _cannot_listen(self, refusal: str) -> str:
        where = ", ".join(self.endpoints)
        for mark, remedy in _REMEDIES.items():
            if mark in refusal:
                return f"the Zenoh router cannot listen on {where}: {remedy}"
        remedy = "Set other listen_endpoints in the transport block"
        return f"the Zenoh router cannot listen on {where}: {refusal}. {remedy}"

    def _join(self) -> None:
        self._guest = open_session(guest_config(self._settings))

    def _router_answers(self) -> bool:
        """Wait for the router that uses the port. Host one if it ends meanwhile."""
        tries = round(_LOOK_S / _POLL_S)
        for look in range(1, round(_ANSWER_S / _POLL_S)):
            if self._guest.info.routers_zid():
                return True
            if look % tries == 0 and not self._host():
                self._leave_guest()
                return True
            if self._stop.wait(_POLL_S):
                return False
        return False

    def _keep(self) -> None:
        while not self._stop.wait(_LOOK_S):
            if self._guest.info.routers_zid():
                continue
            self._host()
            if self.hosting:
                _log.warning("the Zenoh router ended: this process %s", self.description)
                self._leave_guest()
                return

    def _leave_guest(self) -> None:
        """End the session that watches another process's router."""
        with self._lock:
            guest, self._guest = self._guest, None
        if guest is not None:
            close_session(guest)


def prepare(settings: TransportSettings) -> RouterHandle | None:
    """Ensure that this machine has a router; None if discovery is off.

    Raises:
        TransportError: the endpoints or certificates cannot be used.
    """
    require_certificates(settings)
    if settings.discovery_range == "OFF":
        return None
    handle = RouterHandle(settings)
    handle.start()
    return handle
