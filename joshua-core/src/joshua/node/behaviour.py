"""The behaviour interface: what runs inside a node."""

from __future__ import annotations

from abc import ABC, abstractmethod

from joshua.node.context import NodeContext
from joshua.plan import JointTrace, ServiceFacts


class NodeBehaviour(ABC):
    """One node's work, by the lifecycle of ROS 2 managed nodes.

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


class Service(NodeBehaviour):
    """A node that works for the whole robot; its topics are those that the mode plans for it.

    Attributes:
        facts: what the plan tells it of the robot.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self.facts = context.spec.facts_as(ServiceFacts)


class Store(Service):
    """Records, replays or uploads data sets."""


class Trainer(Service):
    """Trains or evaluates a policy, and ends the run when that is done."""


class Simulator(Service):
    """Stands for devices with the physics of a model."""
