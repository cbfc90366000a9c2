"""The router of this machine: for this user's sessions on a UNIX socket, for others on its endpoints."""

from __future__ import annotations

import errno
import logging
import pwd
import socket
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from joshua.plan import TransportSettings
from joshua.transport.transports import TransportError
from joshua.transport.zenoh.endpoints import Endpoint, read_endpoint
from joshua.transport.zenoh.far_routers import FarRouters, addresses_of
from joshua.transport.zenoh.gate import Gate
from joshua.transport.zenoh.meeting import Hosted
from joshua.transport.zenoh.owners import is_trusted, listener_owner
from joshua.transport.zenoh.settings import close_session, open_session, router_config

_log = logging.getLogger("joshua.transport")
#: Time limit for a response of the router on the port, whose process may be stalled.
_ANSWER_S = 5.0
_POLL_S = 0.02
_TRIES = 5
_IN_USE = f"os error {errno.EADDRINUSE}"
_NO_NAME = "failed to lookup address"
_REMEDIES = {
    f"os error {errno.EADDRNOTAVAIL}": (
        "no interface of this machine has that address. Use localhost, 0.0.0.0 for every interface, or an "
        "address that `ip address` lists"
    ),
    f"os error {errno.EACCES}": (
        "only the administrator can use ports below 1024. Choose a higher port, such as 7447"
    ),
    _NO_NAME: "the host name is unknown. Use localhost, or an address of this machine",
}
_OTHERS = "set other listen_endpoints in the transport block"


class _InUseError(Exception):
    """Another program listens on an endpoint."""


class MachineRouter:
    """The router that this process hosts.

    If another program that may be trusted has the port, such as ROS 2's ``rmw_zenohd``, this one links to it
    and takes the port when that program ends. It gets no command from there unless the file allows it.

    Args:
        settings: of the transport; hosted: endpoints of the router, and who may command over it.
        meeting: path of the UNIX socket for this user's sessions.
        stop: ends waiting.

    Raises:
        TransportError: the endpoints cannot be used, or a program has them that cannot be joined.

    Attributes:
        behind: whether another program has the port.
    """

    def __init__(
        self, settings: TransportSettings, hosted: Hosted, meeting: Path, stop: threading.Event
    ) -> None:
        self._settings, self._hosted, self._meeting, self._stop = settings, hosted, meeting, stop
        self._endpoints = [read_endpoint(text) for text in hosted.endpoints]
        local = [endpoint.local for endpoint in self._endpoints]
        self._door = next((endpoint for endpoint in local if endpoint.loopback), local[0])
        self._gated = hosted.reach == "this user"
        self._session: Any = None
        self._gate: Gate | None = None
        self._far: FarRouters | None = None
        self.behind = False
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    @property
    def description(self) -> str:
        """Description for the start-up table."""
        if not self.behind:
            return f"hosts the Zenoh router on {', '.join(self._hosted.endpoints)}"
        joined = f"joined the Zenoh router on {self._door}"
        return f"{joined}, which every user can use: programs behind it only watch" if self._gated else joined

    def close(self) -> None:
        """Stop. Idempotent."""
        if self._far is not None:
            self._far.close()
            self._far = None
        if self._gate is not None:
            self._gate.close()
            self._gate = None
        if self._session is not None:
            session, self._session = self._session, None
            close_session(session)

    def look(self) -> None:
        """Take the port if the program that has it has ended. Called periodically while ``behind``."""
        if not self.behind or self._linked():
            return
        self.close()
        try:
            self._listen()
        except _InUseError:
            self._link()
            return
        self.behind = False
        _log.warning("the Zenoh router ended: this process %s", self.description)

    def _open(self) -> None:
        """Listen, or link to the program that does."""
        end_s = time.monotonic() + _ANSWER_S
        while True:
            try:
                self._listen()
                self.behind = False
                return
            except _InUseError:
                self._require_trusted_owner()
            self._link()
            self.behind = True
            tries_end_s = time.monotonic() + 10 * _POLL_S
            while time.monotonic() < tries_end_s:
                if self._linked():
                    return
                if self._stop.wait(_POLL_S):
                    return
            self.close()  # it may have ended meanwhile
            if time.monotonic() > end_s:
                raise TransportError(self._no_answer())

    def _listen(self) -> None:
        """Host the router on its endpoints. Raises _InUseError or TransportError."""
        if not self._gated:
            self._start([str(endpoint) for endpoint in self._endpoints], self._far_endpoints())
            return
        doors = [endpoint for endpoint in self._endpoints if endpoint.protocol == "tcp"]
        self._gate = self._open_gate(doors)
        others = [str(endpoint) for endpoint in self._endpoints if endpoint not in doors]
        for attempt in range(_TRIES):
            watch = ("127.0.0.1", _free_port())
            try:
                self._start([*others, f"tcp/{watch[0]}:{watch[1]}"], self._far_endpoints())
            except _InUseError:
                if attempt + 1 == _TRIES:
                    self.close()
                    raise
                continue
            break
        self._gate.open(str(self._meeting), watch)

    def _open_gate(self, doors: Sequence[Endpoint]) -> Gate:
        try:
            return Gate(doors)
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise _InUseError from error
            reason = _NO_NAME if isinstance(error, socket.gaierror) else f"os error {error.errno}"
            raise TransportError(self._cannot_listen(reason)) from error

    def _link(self) -> None:
        """Serve this user's sessions, and link to the program that has the port."""
        self._start([], [*self._far_endpoints(), str(self._door)])

    def _start(self, listen: Sequence[str], connect: Sequence[str]) -> None:
        config = router_config(self._settings, self._meeting, listen, connect, watched=self._gated)
        try:
            self._session = open_session(config)
        except TransportError as error:
            if _IN_USE in str(error):
                raise _InUseError from error
            raise TransportError(self._cannot_listen(str(error))) from error
        if self._far_endpoints():
            self._far = FarRouters(self._session, self._far_endpoints())

    def _far_endpoints(self) -> tuple[str, ...]:
        """Routers elsewhere, which a router with narrower rules than the file's does not join."""
        return () if self._gated else self._settings.connect_endpoints

    def _linked(self) -> bool:
        """Whether the program that has the port answers as a router."""
        addresses, _ = addresses_of(str(self._door))
        return any(link.dst in addresses for link in self._session.info.links())

    def _require_trusted_owner(self) -> None:
        owner = listener_owner(self._door.port)
        if owner is None or is_trusted(owner) or self._settings.open_to_local_users:
            return
        raise TransportError(
            f"{_user(owner)} started the program on {self._door}, which could read every message of this run "
            f"and withhold them. Ask that user to stop it, {_OTHERS}, or set open_to_local_users: true there "
            "to join it and let every user of this machine command this robot"
        )

    def _cannot_listen(self, refusal: str) -> str:
        where = ", ".join(self._hosted.endpoints)
        for mark, remedy in _REMEDIES.items():
            if mark in refusal:
                return f"the Zenoh router cannot listen on {where}: {remedy}"
        return f"the Zenoh router cannot listen on {where}: {refusal}. {_OTHERS[0].upper()}{_OTHERS[1:]}"

    def _no_answer(self) -> str:
        return (
            f"another program uses {', '.join(self._hosted.endpoints)} and does not answer as a Zenoh router"
            f"{' with these certificates' if self._settings.tls else ''}, so this run can neither listen "
            f"nor join one there. Stop that program (`ss -ltnp` lists it), or {_OTHERS}"
        )


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _user(number: int) -> str:
    try:
        return f"user {pwd.getpwuid(number).pw_name} ({number})"
    except KeyError:
        return f"user {number}"
