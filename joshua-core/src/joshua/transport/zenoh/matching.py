"""The counterparts of one endpoint: which ones connect, and which ones QoS keeps apart."""

from __future__ import annotations

import threading
from collections.abc import Callable

from joshua.transport.qos_rules import incompatibilities
from joshua.transport.zenoh.keys import PUBLISHER, SUBSCRIPTION, Entity

_NS_PER_S = 1_000_000_000


class Matching:
    """Sorts the other side's endpoints of a topic by the QoS rules of ROS 2.

    The middleware itself connects every pair; this is where both sides learn of a pair that must not.

    Args:
        own: the endpoint whose counterparts are sorted.
        on_incompatible: called with a text for each pair that does not connect.
        on_lost: called when a connected counterpart leaves.
    """

    def __init__(
        self,
        own: Entity,
        on_incompatible: Callable[[str], None],
        on_lost: Callable[[Entity], None] | None = None,
    ) -> None:
        self._own = own
        self._kind = SUBSCRIPTION if own.kind == PUBLISHER else PUBLISHER
        self._on_incompatible, self._on_lost = on_incompatible, on_lost
        self._lock = threading.Lock()
        self.connected: dict[bytes, Entity] = {}
        self.refused: frozenset[bytes] = frozenset()
        self.lifespans_ns: dict[bytes, float] = {}

    def graph_changed(self, entity: Entity, present: bool) -> None:
        """Takes in an endpoint of the topic."""
        own = self._own
        if entity.kind != self._kind or (entity.type_name, entity.type_hash) != (
            own.type_name,
            own.type_hash,
        ):
            return
        if entity.qos is None or own.qos is None:
            return
        gid = entity.gid
        pair = (own.qos, entity.qos) if self._kind == SUBSCRIPTION else (entity.qos, own.qos)
        reasons = incompatibilities(*pair)
        lost = False
        # the sets are replaced, never changed, so that the receive path reads them without the lock
        with self._lock:
            if reasons:
                self.refused = self.refused | {gid} if present else self.refused - {gid}
            elif present:
                self.connected = {**self.connected, gid: entity}
            else:
                lost = gid in self.connected
                self.connected = {key: value for key, value in self.connected.items() if key != gid}
            self.lifespans_ns = {
                key: other.qos.lifespan_s * _NS_PER_S
                for key, other in self.connected.items()
                if other.qos is not None and other.qos.lifespan_s > 0
            }
        if reasons and present:
            side = "subscription" if self._kind == SUBSCRIPTION else "publisher"
            self._on_incompatible(
                f"the {side} of {entity.full_name} on {own.topic} does not connect: {'; '.join(reasons)}"
            )
        if lost and self._on_lost is not None:
            self._on_lost(entity)
