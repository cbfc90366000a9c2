"""The Zenoh router of this machine: hosted by us unless one runs already, and taken over when it dies."""

from __future__ import annotations

import errno
import logging
import threading
from typing import Any

from joshua.plan import TransportSpec
from joshua.transport.errors import TransportError
from joshua.transport.far_routers import FarRouters
from joshua.transport.preconditions import require_usable

_log = logging.getLogger("joshua.transport")
#: A router answers within milliseconds; its program may stand still for a moment.
_ANSWER_S = 5.0
_LOOK_S = 0.2
_POLL_S = 0.02
_IN_USE = f"os error {errno.EADDRINUSE}"
_REMEDIES = {
    f"os error {errno.EADDRNOTAVAIL}": (
        "no interface of this machine has that address. Write localhost, 0.0.0.0 for every interface, or an "
        "address that `ip address` lists"
    ),
    f"os error {errno.EACCES}": (
        "the system allows ports below 1024 to its administrator only. Choose a higher port, such as 7447"
    ),
    "failed to lookup address": "the host is not known here. Write localhost, or an address of this machine",
}


class RouterHandle:
    """This process's part in the router of the machine.

    While another process hosts the router, a thread watches it and hosts a new one on the same
    endpoints as soon as it is gone. Several processes may watch: the port decides who follows.

    Never make one before a fork.

    Attributes:
        endpoints: where the router listens.
    """

    def __init__(self, spec: TransportSpec) -> None:
        from joshua.transport.zenoh.settings import own_router, router_endpoints

        self._spec = spec
        self.endpoints = tuple(str(endpoint) for endpoint in router_endpoints(spec))
        self._reach = str(own_router(spec))
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
        """What happened, for the start-up table."""
        where = ", ".join(self.endpoints)
        if self.hosting:
            return f"hosts the Zenoh router on {where}"
        joined = f"joined the Zenoh router on {self._reach}"
        if self._spec.connect_endpoints:
            joined += ", which another program hosts: connect_endpoints of this file act only if that ends"
        return joined

    def start(self) -> None:
        """Hosts the router, or joins the one that listens already.

        Raises:
            TransportError: the endpoints cannot be used, or something that is no router holds them.
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
                f"another program holds {', '.join(self.endpoints)} and does not answer as a Zenoh router"
                f"{' with these certificates' if self._spec.tls else ''}, so this run can neither listen nor "
                "join one there. Stop that program (`ss -ltnp` lists who listens), or set other "
                "listen_endpoints in the transport block"
            )
        if self._guest is not None:
            self._keeper = threading.Thread(target=self._keep, name="joshua-router-keeper", daemon=True)
            self._keeper.start()

    def close(self) -> None:
        """Stops hosting or watching; a second call does nothing."""
        self._stop.set()
        if self._keeper is not None and threading.current_thread() is not self._keeper:
            self._keeper.join()
        from joshua.transport.zenoh.settings import close_session

        if self._far is not None:
            self._far.close()
            self._far = None
        with self._lock:
            for session in (self._guest, self._router):
                if session is not None:
                    close_session(session)
            self._guest = self._router = None

    def _host(self) -> str:
        """Tries to host; returns why it could not."""
        from joshua.transport.zenoh.settings import open_session, router_config

        try:
            router = open_session(router_config(self._spec))
        except TransportError as error:
            return str(error)
        with self._lock:
            self._router = router
            if self._spec.connect_endpoints:
                self._far = FarRouters(router, self._spec.connect_endpoints)
        return ""

    def _cannot_listen(self, refusal: str) -> str:
        where = ", ".join(self.endpoints)
        for mark, remedy in _REMEDIES.items():
            if mark in refusal:
                return f"the Zenoh router cannot listen on {where}: {remedy}"
        remedy = "Set other listen_endpoints in the transport block"
        return f"the Zenoh router cannot listen on {where}: {refusal}. {remedy}"

    def _join(self) -> None:
        from joshua.transport.zenoh.settings import guest_config, open_session

        self._guest = open_session(guest_config(self._spec))

    def _router_answers(self) -> bool:
        """Waits for the router that has the port; hosts one where that ends just now."""
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
                _log.warning("the Zenoh router was gone; this process now %s", self.description)
                self._leave_guest()
                return

    def _leave_guest(self) -> None:
        """Ends the session that watched another process's router."""
        from joshua.transport.zenoh.settings import close_session

        with self._lock:
            guest, self._guest = self._guest, None
        if guest is not None:
            close_session(guest)


def host_or_join(spec: TransportSpec) -> RouterHandle | None:
    """Makes sure that this machine has a router, as Zenoh needs one; DDS needs none.

    Returns:
        the handle to close at the end; None for DDS, or where nodes are not to find each other.

    Raises:
        TransportError: the endpoints cannot be used.
    """
    if spec.kind != "zenoh" or spec.discovery_range == "OFF":
        require_usable(spec)
        return None
    require_usable(spec)
    handle = RouterHandle(spec)
    handle.start()
    return handle
