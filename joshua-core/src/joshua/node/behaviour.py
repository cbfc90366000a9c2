"""What runs inside a node: the behaviour interface and the context that the runtime hands to it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Protocol

from joshua.plan import NodeSpec, TopicSpec


class MessagePublisher(Protocol):
    """A publisher of ROS 2 messages (classes of ``joshua.messages``)."""

    topic: TopicSpec

    def publish(self, message: Any) -> None:
        """Serialises and sends one message; counts it for the rate figures."""


class NodeContext(Protocol):
    """What the runtime offers to a behaviour, on the node's own thread unless said otherwise.

    Attributes:
        spec: the node's part of the plan.
        log: logger whose records reach the supervisor with the node's name.
    """

    spec: NodeSpec
    log: Any

    def publisher(self, topic: TopicSpec) -> MessagePublisher:
        """Declares a publisher of the node block, or one of the node's own such as ``~/command``."""

    def subscribe(self, topic: TopicSpec, callback: Callable[[Any, int], None]) -> None:
        """Calls ``callback(message, received_ns)`` on a transport thread for each message."""

    def create_timer(self, period_s: float, callback: Callable[[], None], *, name: str = "") -> None:
        """Calls back on the node's thread at a fixed rate on the monotonic clock, without drift."""

    def spawn_thread(self, target: Callable[[], None], *, name: str) -> None:
        """Runs a blocking reader beside the timers; its exception fails the node; joined at the end."""

    @property
    def stopping(self) -> bool:
        """Whether the node has been asked to stop; readers poll it."""

    def now_ns(self) -> int:
        """The node's clock for stamps, ns since the epoch."""

    def fail(self, reason: str) -> None:
        """Ends the node as failed with a reason that names the device and the remedy."""

    def warn(self, text: str) -> None:
        """Adds a warning to the node's row of the start-up table."""


class NodeBehaviour(ABC):
    """One node's work, by the lifecycle of ROS 2 managed nodes.

    Order: ``configure`` (open the device, declare topics) → ``activate`` (start moving and publishing)
    → ``deactivate`` (stop moving, safe state) → ``cleanup`` (close the device). ``deactivate`` and
    ``cleanup`` also run after a failure and are idempotent. The constructor does no I/O.
    """

    def __init__(self, context: NodeContext) -> None:
        self.context = context

    @abstractmethod
    def configure(self) -> None:
        """Opens the device and declares topics; nothing moves yet."""

    def activate(self) -> None:
        """Starts moving and publishing."""

    def deactivate(self) -> None:
        """Stops moving and leaves the device in its safe state."""

    def cleanup(self) -> None:
        """Closes the device."""

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Results for the pass/fail table of MODE_TEST: (check, passed, measured)."""
        return []
