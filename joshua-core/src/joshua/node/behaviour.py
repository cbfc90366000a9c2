"""What runs inside a node: the behaviour interface and the context that the runtime hands to it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Protocol

from joshua.plan import JointTrace, NodeSpec, TopicSpec


class MessagePublisher(Protocol):
    """A publisher of ROS 2 messages (classes of ``joshua.messages``)."""

    topic: TopicSpec

    def publish(self, message: Any) -> None:
        """Serialises and sends one message; counts it for the rate figures."""


class NodeContext(Protocol):
    """What the runtime offers to a behaviour, on the node's own thread unless said otherwise.

    Attributes:
        spec: the node's part of the plan; ``spec.facts.restarted`` is true after a failure.
        log: logger whose records reach the supervisor with the node's name.
    """

    spec: NodeSpec
    log: Any

    def publisher(self, topic: TopicSpec) -> MessagePublisher:
        """Declares a publisher of the node block, or one of the node's own such as ``~/command``."""

    def subscribe(self, topic: TopicSpec, callback: Callable[[Any, int], None]) -> None:
        """Calls ``callback(message, received_ns)`` on a transport thread for each message.

        Its exception fails the node. A payload that is no message of the type is logged and skipped.
        """

    def subscribe_named(self, topic: TopicSpec, callback: Callable[[Any, int, str], None]) -> None:
        """Calls ``callback(message, received_ns, publisher)``; else as ``subscribe``.

        ``publisher`` is the full name of the node that sent the message, "" for a program that is no ROS 2
        node. Messages that come before the graph knows their publisher are dropped, for a second at most.
        """

    def create_timer(self, period_s: float, callback: Callable[[], None], *, name: str = "") -> None:
        """Calls back on the node's thread at a fixed rate on the monotonic clock, without drift.

        The first tick comes one period after ``activate`` has returned. Ticks that a long callback
        runs over are skipped and counted.
        """

    def spawn_thread(
        self, target: Callable[[], None], *, name: str, hang_after_s: float | None = None
    ) -> None:
        """Runs a blocking reader beside the timers; its exception fails the node; joined at the end.

        Args:
            target: returns soon after ``stopping`` has become true, and asks for it all the time: a
                reader that does not ask for ``hang_after_s`` counts as hung.
            name: for logs and reports.
            hang_after_s: the limit; None takes the one of the node's kind.
        """

    @property
    def stopping(self) -> bool:
        """Whether the node has been asked to stop; readers poll it."""

    def now_ns(self) -> int:
        """The node's clock for stamps, ns since the epoch."""

    def fail(self, reason: str) -> None:
        """Ends the node as failed with a reason that names the device and the remedy; any thread."""

    def warn(self, text: str) -> None:
        """Adds a warning to the node's row of the start-up table; any thread."""

    def waiting_for(self, text: str) -> None:
        """Says what the node waits for, for the message of a start that takes too long; "" ends it."""

    def fault(self, reason: str) -> None:
        """Says that the node goes on, but its device does nothing until it is resumed; "" ends that."""

    def show(self, text: str) -> None:
        """Puts a short text into the node's part of the live status line; "" takes it away; any thread."""

    def progress(
        self,
        name: str,
        current: float,
        total: float | None = None,
        *,
        unit: str = "",
        rate: float | None = None,
        remaining_s: float | None = None,
    ) -> None:
        """Says how far work is that ends, as often as it likes; any thread.

        Args:
            name: of the work, such as ``episodes``.
            current: what is done, in ``unit``; total: all of it, None where nobody knows.
            rate: units a second; remaining_s: time to the end. None computes them from what was said before.
        """

    def end_run(self, reason: str) -> None:
        """Asks for the end of the whole run in good order: the node's work is done; any thread."""


class NodeBehaviour(ABC):
    """One node's work, by the lifecycle of ROS 2 managed nodes.

    Order: ``configure`` (open the device, declare topics) → ``activate`` (start moving and publishing)
    → ``deactivate`` (stop moving, safe state) → ``cleanup`` (close the device). No node of a run is
    activated before every node is configured. ``deactivate`` and ``cleanup`` also run after a failure,
    in whichever step, and are idempotent. The constructor does no I/O.

    All steps run on the node's thread. While a timer's callback or a step runs, the node shows no other
    sign of life: after ``activate`` an actuator that is silent for 0.2 s counts as hung.
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

    def verb_providers(self) -> tuple[object, ...]:
        """The objects whose methods may be verbs of the node; a behaviour adds the driver that it has."""
        return (self,)

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Results for the pass/fail table of MODE_TEST: (check, passed, measured).

        Called after ``deactivate`` and before ``cleanup``.
        """
        return []

    def test_traces(self) -> list[JointTrace]:
        """How each joint moved during MODE_TEST, for the pictures; called after ``test_results``."""
        return []
