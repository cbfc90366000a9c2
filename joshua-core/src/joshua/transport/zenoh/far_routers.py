"""The links of a router to routers on other machines, and what the log says about them."""

from __future__ import annotations

import logging
import socket
import threading
import time
from collections.abc import Sequence
from typing import Any

from joshua.transport.zenoh.endpoints import read_endpoint

_log = logging.getLogger("joshua.transport")
_LINK_LOOK_S = 0.5
_NAMES_HOLD_S = 10.0
#: A router responds within milliseconds, over a network somewhat later.
_PATIENCE_S = 3.0


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
            addresses, reason = addresses_of(endpoint)
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


def addresses_of(endpoint: str) -> tuple[set[str], str]:
    """Names of the links to an endpoint, or why its host has no address."""
    parsed = read_endpoint(endpoint)
    try:
        found = socket.getaddrinfo(parsed.host, parsed.port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):  # the latter where it cannot be a name
        return set(), f"the host name {parsed.host} cannot be resolved"
    hosts = [str(entry[4][0]) for entry in found]
    return {f"{parsed.protocol}/{f'[{host}]' if ':' in host else host}:{parsed.port}" for host in hosts}, ""
