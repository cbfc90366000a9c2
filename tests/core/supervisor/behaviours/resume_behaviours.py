"""A node with a fault that is ended from outside."""

from __future__ import annotations

import time
from pathlib import Path

from joshua.node.behaviour import NodeBehaviour
from joshua.node.errors import NodeError
from joshua.node.verbs import RefusedError, verb


class StopsLate(NodeBehaviour):
    """Stops once a file is there."""

    def configure(self) -> None:
        self.context.create_timer(0.01, lambda: None, name="tick")

    def deactivate(self) -> None:
        while not Path(self.context.spec.settings["gate"]).exists():
            time.sleep(0.01)


class Faulty(NodeBehaviour):
    """Is in fault from the start; what ``resume`` does stands in a file, so that it can change."""

    @property
    def wish(self) -> str:
        return Path(self.context.spec.settings["wish"]).read_text()

    def configure(self) -> None:
        self.context.create_timer(0.01, lambda: None, name="tick")
        if self.wish == "gone":
            raise NodeError("the arm is not there")

    def activate(self) -> None:
        self.context.fault("tripped")

    @verb(moves=True, runs="activation")
    def resume(self) -> str:
        wish = self.wish
        if wish == "slow":
            time.sleep(2.0)
        while wish == "wait":
            time.sleep(0.01)
            wish = self.wish
        if wish == "refuse":
            raise RefusedError("still too hot")
        if wish in ("fail", "gone"):
            raise NodeError("the cable is gone")
        self.context.fault("")
        return "has torque again"
