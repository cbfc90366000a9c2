"""Services over Zenoh by the conventions of rmw_zenoh: a server is a queryable, a call a query.

Source: ros2/rmw_zenoh, docs/design.md, "Service Servers" and "Service Clients".
"""

from __future__ import annotations

import logging
import time
from concurrent.futures import Future
from typing import TYPE_CHECKING, Any

import zenoh

from joshua.transport.delivery import Delivery
from joshua.transport.transports import Endpoint, Serve, TransportError
from joshua.transport.zenoh.keys import ATTACHMENT, Entity

if TYPE_CHECKING:
    from joshua.transport.zenoh.transport import ZenohNode

_log = logging.getLogger("joshua.transport")


class ZenohService(Endpoint):
    """Answers the queries of one service on its node's service thread."""

    def __init__(
        self,
        node: ZenohNode,
        entity: Entity,
        key: str,
        serve: Serve,
        requests: Delivery,
    ) -> None:
        super().__init__(node, entity.topic)
        self._key, self._serve = key, serve
        session = node.home.session
        handler: Any = zenoh.handlers.Callback(
            lambda query: requests.push(lambda: self._answer(query)), indirect=False
        )
        self._queryable: Any = session.declare_queryable(key, handler, complete=True)
        self._token: Any = session.liveliness().declare_token(entity.token)

    def _leave(self) -> None:
        self._token.undeclare()
        self._queryable.undeclare()

    def _answer(self, query: Any) -> None:
        attachment = query.attachment.to_bytes() if query.attachment is not None else b""
        if self._closed or query.payload is None or len(attachment) != ATTACHMENT.size:
            query.drop()  # not from a ROS 2 client
            return
        sequence, _, length, gid = ATTACHMENT.unpack(attachment)

        def reply(answer: Future[bytes]) -> None:
            if not self._closed and not answer.cancelled():
                sent = ATTACHMENT.pack(sequence, time.time_ns(), length, gid)
                query.reply(self._key, answer.result(), attachment=sent)
            query.drop()

        try:
            response = self._serve(query.payload.to_bytes())
            answer = response if isinstance(response, Future) else Future()
            if not isinstance(response, Future):
                answer.set_result(response)
        except Exception as error:  # noqa: BLE001 - a failing service must not end the others
            _log.exception("the service %s failed", self.topic)
            query.reply_err(f"{type(error).__name__}: {error}".encode())
            query.drop()
            return
        answer.add_done_callback(reply)


def call(session: zenoh.Session, client: Entity, key: str, request: bytes, timeout_s: float) -> bytes:
    """Call a service once.

    Raises:
        TransportError: no response in time, or the server refuses.
    """
    replies: Any = session.get(
        key,
        target=zenoh.QueryTarget.ALL_COMPLETE,
        consolidation=zenoh.ConsolidationMode.NONE,
        timeout=timeout_s,
        payload=request,
        attachment=ATTACHMENT.pack(1, time.time_ns(), 16, client.gid),
    )
    refusals = []
    for reply in replies:
        if reply.ok is not None:
            return bytes(reply.ok.payload.to_bytes())
        refusals.append(reply.err.payload.to_string())
    if refusals and "imeout" not in refusals[0]:
        raise TransportError(f"the service {client.topic} failed: {refusals[0]}")
    raise TransportError(f"the service {client.topic} did not answer within {timeout_s:g} s")
