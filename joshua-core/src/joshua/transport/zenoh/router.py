"""The Zenoh router of this machine as a run finds it: hosted here, or by another process of this user."""

from __future__ import annotations

import logging
import os
import threading
import time
from typing import Any

from joshua.plan import TransportSettings
from joshua.transport.transports import TransportError
from joshua.transport.zenoh.machine_router import MachineRouter
from joshua.transport.zenoh.meeting import Hosted, MeetingPlace, reach_of
from joshua.transport.zenoh.settings import (
    close_session,
    open_session,
    require_certificates,
    router_endpoints,
    run_router_config,
)

_log = logging.getLogger("joshua.transport")
#: How long a process of this user may take to open the router after it got the lock; it may be stalled.
_ANSWER_S = 5.0
_LOOK_S = 0.2
_POLL_S = 0.02


class RouterHandle:
    """Links a run to the router of the machine, which this process or another one of this user hosts.

    A run with a ``link_folder`` also gets a router of its own in that folder, so its nodes depend on no other
    process than this one. If the host of the machine's router dies, a thread hosts a new one on the same
    endpoints, with the same rules. Several processes may watch; a lock decides which one succeeds. Never
    create one before a fork.
    """

    def __init__(self, settings: TransportSettings) -> None:
        self._settings = settings
        endpoints = tuple(str(endpoint) for endpoint in router_endpoints(settings))
        self._hosted = Hosted(os.getpid(), endpoints, reach_of(settings))
        self._place = MeetingPlace(settings)
        self._router: MachineRouter | None = None
        self._run_router: Any = None
        self._stop = threading.Event()
        self._keeper: threading.Thread | None = None

    @property
    def hosting(self) -> bool:
        """Whether this process hosts the router."""
        return self._router is not None and not self._router.behind

    @property
    def description(self) -> str:
        """Description for the start-up table."""
        if (router := self._router) is not None:
            return router.description
        joined = f"joined the Zenoh router on {', '.join(self._hosted.endpoints)}"
        if self._settings.connect_endpoints:
            joined += (
                ", which another program hosts: connect_endpoints of this file have no effect while it runs"
            )
        return joined

    def start(self) -> None:
        """Host the router, or join the one of another process of this user.

        Raises:
            TransportError: the endpoints cannot be used, another user or a program that is no router has
                them, or the running router takes commands from more users than this file allows.
        """
        try:
            self._find_place()
            if self._settings.link_folder:
                config = run_router_config(self._settings.link_folder, self._place.sockets)
                self._run_router = open_session(config, warn=False)
        except BaseException:
            self.close()
            raise
        if not self.hosting:
            self._keeper = threading.Thread(target=self._keep, name="joshua-router-keeper", daemon=True)
            self._keeper.start()

    def close(self) -> None:
        """Stop hosting or watching. Idempotent."""
        self._stop.set()
        if self._keeper is not None and threading.current_thread() is not self._keeper:
            self._keeper.join()
        run_router, self._run_router = self._run_router, None
        if run_router is not None:
            close_session(run_router)
        router, self._router = self._router, None
        if router is not None:
            router.close()
        self._place.leave()

    def _find_place(self) -> None:
        end_s = time.monotonic() + _ANSWER_S
        while not self._host():
            if (other := self._place.hosted()) is not None:
                self._join(other)
                return
            if time.monotonic() > end_s or self._stop.wait(_POLL_S):
                raise TransportError(
                    f"a process of this user holds the lock {self._place.lock_file} but hosts no Zenoh "
                    f"router. `fuser {self._place.lock_file}` names it. Stop it, or set other "
                    "listen_endpoints in the transport block"
                )

    def _host(self) -> bool:
        """Become the host; False if another process of this user is. Raises TransportError."""
        if not self._place.take(self._hosted):
            return False
        try:
            self._router = MachineRouter(self._settings, self._hosted, self._place.socket, self._stop)
        except BaseException:
            self._place.leave()
            raise
        return True

    def _join(self, other: Hosted) -> None:
        """Accept the rules of another process's router, also for the time after it."""
        if other.reach not in ("this user", self._hosted.reach):
            who = "everyone who reaches it" if other.reach == "everyone" else "everyone with a certificate"
            raise TransportError(
                f"the Zenoh router on {', '.join(other.endpoints)}, which process {other.process_id} hosts, "
                f"takes commands from {who}, and the transport block of this file does not. Stop that run, "
                "or set other listen_endpoints in the transport block of one of them"
            )
        self._hosted = Hosted(os.getpid(), other.endpoints, other.reach)

    def _keep(self) -> None:
        said = ""
        while not self._stop.wait(_LOOK_S):
            try:
                if self._router is not None:
                    self._router.look()
                elif self._host():
                    _log.warning("the Zenoh router ended: this process %s", self.description)
            except TransportError as error:
                if str(error) != said:
                    said = str(error)
                    _log.warning("the Zenoh router ended and cannot be replaced yet: %s", said)


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
