"""A publisher over DDS."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Any

from cyclonedds.pub import DataWriter

from joshua.plan import QosProfile
from joshua.transport.api import Buffer, Publisher
from joshua.transport.dds import raw
from joshua.transport.dds.qos import endpoint_qos
from joshua.transport.errors import TransportError

if TYPE_CHECKING:
    from collections.abc import Callable

    from cyclonedds.domain import DomainParticipant


_BLOCKING_S = 0.1
_RETRY_S = 0.0005


class DdsPublisher(Publisher):
    """Writes CDR payloads as they are."""

    def __init__(
        self,
        participant: DomainParticipant,
        topic: Any,
        name: str,
        type_name: str,
        qos: QosProfile,
        leave: Callable[[DdsPublisher], None],
    ) -> None:
        self.name = name
        self._leave = leave
        self._lock = threading.Lock()
        self._closed = False
        with raw.READING_QOS:
            self.entity: Any = DataWriter(
                participant, topic, qos=endpoint_qos(qos, type_name, is_writer=True)
            )
        self.gid: bytes = self.entity.guid.bytes

    def publish(self, cdr: Buffer) -> None:
        """Sends one serialised message."""
        with self._lock:
            if self._closed:
                raise TransportError(f"the publisher of {self.name} is closed")
            if not raw.write(self.entity, cdr):
                self._write_late(cdr)

    def _write_late(self, cdr: Buffer) -> None:
        """Tries again while the readers catch up, for as long as ROS 2 lets a reliable writer wait."""
        end_s = time.monotonic() + _BLOCKING_S
        while time.monotonic() < end_s:
            time.sleep(_RETRY_S)
            if raw.write(self.entity, cdr):
                return
        raise TransportError(
            f"a reliable subscription of {self.name} did not keep up for {_BLOCKING_S:g} s: the message "
            "was not sent; publish less often, or use BEST_EFFORT or KEEP_LAST"
        )

    @property
    def subscription_count(self) -> int:
        """Matched subscriptions."""
        return 0 if self._closed else len(self.entity.get_matched_subscriptions())

    def assert_liveliness(self) -> None:
        """Says that this publisher is alive."""
        if not self._closed:
            raw.assert_liveliness(self.entity)

    def close(self) -> None:
        """Leaves the graph."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        self._leave(self)
        raw.delete(self.entity)
