"""Manual liveliness between our own nodes, beside the conventions of rmw_zenoh, which has none.

A publisher with MANUAL_BY_TOPIC liveliness marks itself with the token ``@joshua_alive/<domain>/<gid>``
and puts an empty message on the same key when it asserts that it is alive.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import zenoh

_SPACE = "@joshua_alive"


class Assertions:
    """The publisher's side."""

    def __init__(self, session: zenoh.Session, domain_id: int, gid: bytes) -> None:
        key = f"{_SPACE}/{domain_id}/{gid.hex()}"
        self._publisher: Any = session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.BLOCK
        )
        self._token: Any = session.liveliness().declare_token(key)

    def send(self) -> None:
        """Asserts that the publisher is alive."""
        self._publisher.put(b"")

    def close(self) -> None:
        """Withdraws the mark."""
        self._token.undeclare()
        self._publisher.undeclare()


class AssertionListener:
    """The subscription's side.

    Args:
        marked: called with a gid whose publisher asserts by hand.
        asserted: called with the gid of each assertion.
    """

    def __init__(
        self,
        session: zenoh.Session,
        domain_id: int,
        marked: Callable[[bytes], None],
        asserted: Callable[[bytes], None],
    ) -> None:
        key = f"{_SPACE}/{domain_id}/*"
        self._subscriber: Any = session.declare_subscriber(
            key, _direct(lambda sample: asserted(_gid(sample)))
        )
        self._tokens: Any = session.liveliness().declare_subscriber(
            key,
            _direct(lambda sample: marked(_gid(sample)) if sample.kind == zenoh.SampleKind.PUT else None),
            history=True,
        )

    def close(self) -> None:
        """Stops listening."""
        self._tokens.undeclare()
        self._subscriber.undeclare()


def _direct(call: Callable[[zenoh.Sample], None]) -> zenoh.handlers.Callback[zenoh.Sample]:
    return zenoh.handlers.Callback(call, indirect=False)


def _gid(sample: zenoh.Sample) -> bytes:
    """The gid in a key; b"" for a key of somebody else's making."""
    try:
        return bytes.fromhex(str(sample.key_expr).rsplit("/", 1)[1])
    except ValueError:
        return b""
