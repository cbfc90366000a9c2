"""A subscription over DDS: a thread that waits for its reader and forwards its samples."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from cyclonedds.core import GuardCondition, InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.internal import dds_infinity
from cyclonedds.sub import DataReader
from joshua.api.transports import Emit, QosProfile, Sample, Subscription

from joshua_dds import raw
from joshua_dds.qos import endpoint_qos
from joshua_dds.taking import Taker

if TYPE_CHECKING:
    from joshua_dds.transport import DdsNode

#: Number of publishers whose gids are cached.
_KNOWN_PUBLISHERS = 1000

_log = logging.getLogger("joshua.transport")


class DdsSubscription(Subscription):
    """Takes one sample at a time, so that the reader's own history is the receive queue."""

    def __init__(
        self,
        node: DdsNode,
        topic: str,
        type_name: str,
        qos: QosProfile,
        callback: Callable[[Sample], None],
        emit: Emit | None,
    ) -> None:
        super().__init__(node, topic)
        self._home = home = node.home
        self._callback = callback
        self._gids: dict[int, bytes] = {}
        policies = endpoint_qos(qos, type_name, is_writer=False)
        self.entity: Any = DataReader(home.participant, home.topic(topic, type_name), qos=policies)
        self.gid: bytes = self.entity.guid.bytes
        self._data = ReadCondition(self.entity, SampleState.Any | ViewState.Any | InstanceState.Any)
        self._stop = GuardCondition(home.participant)
        self._waitset: Any = WaitSet(home.participant)
        self._waitset.attach(self._data)
        self._waitset.attach(self._stop)
        self._thread = threading.Thread(target=self._run, name=f"joshua-sub {topic}", daemon=True)
        self._thread.start()
        home.watch(self.entity, topic, qos, False, emit)

    @property
    def publisher_count(self) -> int:
        """Matched publishers."""
        return 0 if self._closed else len(self.entity.get_matched_publications())

    def _leave(self) -> None:
        raw.trigger(self._stop)
        if threading.current_thread() is not self._thread:
            self._thread.join()
        self._home.events.remove(self.entity)
        for condition in (self._data, self._stop):
            self._waitset.detach(condition)
        for entity in (self._waitset, self._data, self._stop, self.entity):
            raw.delete(entity)

    def _run(self) -> None:
        wait, take, callback = self._waitset.wait, Taker(self.entity).take, self._callback
        while not self._ended():
            wait(dds_infinity)
            if self._ended():
                return
            taken = take()
            if taken is None or taken.cdr is None:
                continue
            handle = taken.publication_handle
            gid = self._gids.get(handle) or self._look_up(handle)
            sample = Sample(taken.cdr, taken.source_timestamp_ns, time.time_ns(), 0, gid)
            try:
                callback(sample)
            except Exception:  # noqa: BLE001 - a failing callback must not end the subscription
                _log.exception("the callback of joshua-sub %s failed", self.topic)
            # a sample kept here would keep its buffer until the next one arrives
            del taken, sample

    def _ended(self) -> bool:
        """Return whether close was called, by another thread or by the callback itself."""
        return self._closed

    def _look_up(self, handle: int) -> bytes:
        try:
            with raw.READING_QOS:
                publisher = self.entity.get_matched_publication_data(handle)
        except Exception:  # noqa: BLE001 - the message is delivered even if its sender is unknown
            _log.exception("DDS does not name the publisher of a message on %s", self.topic)
            return _handle_id(handle)
        if publisher is None:
            return _handle_id(handle)  # it left before its last message was taken
        if len(self._gids) >= _KNOWN_PUBLISHERS:
            self._gids.clear()  # most of them have left
        self._gids[handle] = publisher.key.bytes
        return self._gids[handle]


def _handle_id(handle: int) -> bytes:
    """Return an id of a publisher whose GUID is unknown. No GUID begins with zeros."""
    return handle.to_bytes(16, "big")
