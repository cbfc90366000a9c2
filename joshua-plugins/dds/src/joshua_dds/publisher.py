"""A publisher over DDS."""

from __future__ import annotations

import logging
import time
from typing import TYPE_CHECKING, Any

from cyclonedds.pub import DataWriter
from joshua.api.transports import Buffer, Emit, Publisher, QosProfile, TransportError

from joshua_dds import raw
from joshua_dds.qos import endpoint_qos

if TYPE_CHECKING:
    from joshua_dds.transport import DdsNode

_BLOCKING_S = 0.1
_RETRY_S = 0.0005
#: The first dropped message is logged, then each power of ten.
_LOGGED_COUNTS = frozenset(10**power for power in range(12))

_log = logging.getLogger("joshua.transport")


class DdsPublisher(Publisher):
    """Publisher that writes CDR payloads unchanged."""

    def __init__(
        self,
        node: DdsNode,
        topic: str,
        type_name: str,
        qos: QosProfile,
        emit: Emit | None,
    ) -> None:
        super().__init__(node, topic)
        self._home = home = node.home
        self._waits, self._dropped = qos.history == "KEEP_ALL", 0
        policies = endpoint_qos(qos, type_name, is_writer=True)
        with raw.READING_QOS:
            self.entity: Any = DataWriter(home.participant, home.topic(topic, type_name), qos=policies)
        self.gid: bytes = self.entity.guid.bytes
        home.watch(self.entity, topic, qos, True, emit)

    def publish(self, cdr: Buffer) -> None:
        """Send one serialised message."""
        with self._lock:
            if self._closed:
                raise TransportError(f"the publisher of {self.topic} is closed")
            if raw.write(self.entity, cdr):
                return
            if self._waits:
                self._write_late(cdr)
                return
            self._dropped += 1
        if self._dropped in _LOGGED_COUNTS:
            _log.warning(
                "%s: %d messages were not sent, because a reliable subscription does not keep up",
                self.topic,
                self._dropped,
            )

    def _write_late(self, cdr: Buffer) -> None:
        """Retry while the readers catch up, for as long as ROS 2 lets a reliable writer wait."""
        end_s = time.monotonic() + _BLOCKING_S
        while time.monotonic() < end_s:
            time.sleep(_RETRY_S)
            if raw.write(self.entity, cdr):
                return
        raise TransportError(
            f"a reliable subscription of {self.topic} did not keep up for {_BLOCKING_S:g} s: the message "
            "was not sent. Publish less often, or use BEST_EFFORT or KEEP_LAST"
        )

    @property
    def subscription_count(self) -> int:
        """Matched subscriptions."""
        return 0 if self._closed else len(self.entity.get_matched_subscriptions())

    def assert_liveliness(self) -> None:
        """Assert that this publisher is alive."""
        if not self._closed:
            raw.assert_liveliness(self.entity)

    def _leave(self) -> None:
        self._home.events.remove(self.entity)
        raw.delete(self.entity)
