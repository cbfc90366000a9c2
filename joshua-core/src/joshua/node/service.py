"""The behaviours of nodes behind which no device stands: stores, trainers and simulators."""

from __future__ import annotations

from joshua.node.behaviour import NodeBehaviour


class Service(NodeBehaviour):
    """A node that works for the whole robot; its topics are those that the mode plans for it."""


class Store(Service):
    """Keeps what a robot did: it records, replays or uploads data sets."""


class Trainer(Service):
    """Trains or evaluates a policy, and ends the run when that is done."""


class Simulator(Service):
    """Stands for devices with the physics of a model."""
