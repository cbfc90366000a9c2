"""The behaviour interface: the code that runs inside a node."""

from __future__ import annotations

from abc import ABC, abstractmethod

from joshua.node.context import NodeContext
from joshua.plan import JointTrace, ServiceFacts


class NodeBehaviour(ABC):
    """The work of one node, in the lifecycle of ROS 2 managed nodes.

    Order: ``configure`` (open the device, declare topics) → ``activate`` (start moving and publishing)
    → ``deactivate`` (stop moving, safe state) → ``cleanup`` (close the device). No node of a run is
    activated before every node is configured. ``deactivate`` and ``cleanup`` also run after a failure,
    in whichever step, and are idempotent. The constructor does no I/O.

    All steps run on the node's thread. It sends no heartbeat while a timer's callback or a step runs. After
    ``activate``, an actuator without heartbeat for ``hang_after_s`` (0.3 s by default) counts as hung.
    """

    def __init__(self, context: NodeContext) -> None:
        self.context = context

    @abstractmethod
    def configure(self) -> None:
        """Opens the device and declares topics, without motion."""

    def activate(self) -> None:
        """Starts moving and publishing."""

    def deactivate(self) -> None:
        """Stops moving and leaves the device in its safe state."""

    def cleanup(self) -> None:
        """Closes the device."""

    def estop(self) -> None:
        """Looks for an e-stop: one was latched or released. Called between two timers while active."""

    def verb_providers(self) -> tuple[object, ...]:
        """The objects whose methods may be verbs of the node: the behaviour and its driver, if any."""
        return (self,)

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Results for the pass/fail table of MODE_TEST: (check, passed, measured).

        Called after ``deactivate`` and before ``cleanup``.
        """
        return []

    def test_traces(self) -> list[JointTrace]:
        """The motion of each joint during MODE_TEST, for the pictures. Called after ``test_results``."""
        return []


class Service(NodeBehaviour):
    """A node that works for the whole robot. The mode plans its topics.

    Attributes:
        facts: its part of the plan.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self.facts = context.spec.facts_as(ServiceFacts)


class Store(Service):
    """Records, replays or uploads data sets."""


class Trainer(Service):
    """Trains or evaluates a policy, and ends the run when done."""


class Simulator(Service):
    """Simulates devices with the physics of a model."""
