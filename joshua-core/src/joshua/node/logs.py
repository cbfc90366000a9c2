"""Log records of a node: structured over the control socket, with a rate limit, and on ``/rosout``."""

from __future__ import annotations

import logging
import threading
import time
import traceback
from collections.abc import Callable
from typing import Any

from joshua.ipc.line_budget import LINES_PER_S, LineBudget
from joshua.ipc.messages import Log
from joshua.messages import encode, message_class
from joshua.plan import NodeSpec, QosProfile
from joshua.plan.foreign_text import printable
from joshua.transport import NodeHandle

#: Characters kept of one record.
MAX_TEXT = 8000


class NodeLogHandler(logging.Handler):
    """Sends records to the supervisor with the name of their node.

    A record belongs to the node of its thread, else to the process's first node.
    """

    def __init__(self, send: Callable[[Log], None], default_node: str) -> None:
        super().__init__()
        self._send = send
        self._default_node = default_node
        self._threads = threading.local()
        self._budgets: dict[str, LineBudget] = {}
        self._observers: dict[str, Callable[[Log], None]] = {}

    def adopt_thread(self, node: str) -> None:
        """Assigns further records of the calling thread to a node."""
        self._threads.node = node

    def observe(self, node: str, observer: Callable[[Log], None] | None) -> None:
        """Also passes each record of a node to ``observer``, such as a publisher; None ends that."""
        if observer is None:
            self._observers.pop(node, None)
        else:
            self._observers[node] = observer

    def settle(self, node: str, *, ended: bool = False) -> None:
        """Reports the dropped lines of a node, once lines may pass again or it has ended."""
        if dropped := self._budget(node).settle(ended=ended):
            text = f"{dropped} log lines dropped: more than {LINES_PER_S} in a second"
            level, time_ns = logging.WARNING, time.time_ns()
            self._send(Log(node=node, time_ns=time_ns, level=level, text=text, logger="joshua.node"))

    def emit(self, record: logging.LogRecord) -> None:
        """Sends one record. Never raises, whatever the record's arguments are."""
        node: str = getattr(record, "node", "") or getattr(self._threads, "node", self._default_node)
        self.settle(node)
        if not self._budget(node).take():
            return
        log = Log(
            node=node,
            time_ns=round(record.created * 1e9),
            level=record.levelno,
            text=printable(self._text(record), MAX_TEXT),
            logger=record.name,
            file=record.pathname,
            line=record.lineno,
        )
        self._send(log)
        observer = self._observers.get(node)
        if observer is not None:
            self._show(node, observer, log)

    def _budget(self, node: str) -> LineBudget:
        return self._budgets.setdefault(node, LineBudget())

    def _show(self, node: str, observer: Callable[[Log], None], log: Log) -> None:
        try:
            observer(log)
        except Exception as error:  # noqa: BLE001 (a record that cannot be shown must not fail the node)
            if self._observers.pop(node, None) is None:
                return  # the node ends, and another thread has ended this first
            text = f"log records are not published any more: {error}"
            self._send(Log(node=node, time_ns=time.time_ns(), level=logging.WARNING, text=printable(text)))

    @staticmethod
    def _text(record: logging.LogRecord) -> str:
        try:
            text = record.getMessage()
        except Exception as error:  # noqa: BLE001 (a wrong format string must not fail the node)
            text = f"{record.msg!r} with arguments {record.args!r} cannot be formatted: {error}"
        if record.exc_info and record.exc_info[0] is not None:
            text = f"{text}\n{''.join(traceback.format_exception(*record.exc_info)).rstrip()}"
        return text


def node_logger(full_name: str, level: int) -> logging.Logger:
    """Makes the logger of a node. Its records carry the node's name on every thread."""
    logger = logging.getLogger("node" + full_name.replace("/", "."))
    logger.setLevel(level)

    def mark(record: logging.LogRecord) -> bool:
        record.node = full_name
        return True

    logger.filters[:] = [mark]
    return logger


def install_handler(handler: NodeLogHandler, level: int) -> None:
    """Makes the handler the only one of this process, warnings included."""
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level)
    logging.captureWarnings(True)


#: Profile of rclcpp's rosout publisher (``rclcpp::RosoutQoS``).
ROSOUT_QOS = QosProfile(durability="TRANSIENT_LOCAL", depth=1000, lifespan_s=10.0)

#: Profile of rclcpp's parameter events (``rclcpp::ParameterEventsQoS``).
PARAMETER_EVENTS_QOS = QosProfile(depth=1000)

#: Levels of rcl_interfaces/msg/Log are those of ``logging``.
LEVELS = (10, 20, 30, 40, 50)


class RosoutPublisher:
    """Publishes log records of a node, and declares the topics that every ROS 2 node has from its start.

    Args:
        handle: the node in the graph.
        spec: the node's part of the plan.
    """

    def __init__(self, handle: NodeHandle, spec: NodeSpec) -> None:
        self.parameter_events = handle.create_publisher(
            "/parameter_events", "rcl_interfaces/msg/ParameterEvent", PARAMETER_EVENTS_QOS
        )
        self._publisher = handle.create_publisher("/rosout", "rcl_interfaces/msg/Log", ROSOUT_QOS)
        self._name = spec.full_name.strip("/").replace("/", ".")
        self._busy = threading.local()

    def publish(self, log: Log) -> None:
        """Publishes one record, except records caused by publishing."""
        if getattr(self._busy, "active", False):
            return
        self._busy.active = True
        try:
            self._publisher.publish(encode(self._message(log)))
        finally:
            self._busy.active = False

    def _message(self, log: Log) -> Any:
        seconds, nanoseconds = divmod(log.time_ns, 1_000_000_000)
        time_class = message_class("builtin_interfaces/msg/Time")
        return message_class("rcl_interfaces/msg/Log")(
            stamp=time_class(sec=seconds, nanosec=nanoseconds),
            level=max((level for level in LEVELS if level <= log.level), default=LEVELS[0]),
            name=self._name,
            msg=log.text,
            file=log.file,
            function="",
            line=log.line,
        )
