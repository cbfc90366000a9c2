"""Nodes with verbs, some of which do not end well."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field
from pathlib import Path

from joshua.node.behaviour import NodeBehaviour
from joshua.node.verbs import RefusedError, verb


@dataclass(frozen=True)
class Wave:
    times: int = 1
    tags: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Waved:
    done: int
    thread: str


class Waver(NodeBehaviour):
    """Waves, and takes its time, and breaks."""

    def configure(self) -> None:
        self.context.create_timer(0.01, lambda: None, name="tick")

    def note(self, text: str) -> None:
        with Path(self.context.spec.settings["notes"]).open("a") as notes:
            notes.write(f"{text}\n")

    @verb(moves=True)
    def wave(self, wave: Wave) -> Waved:
        """Waves."""
        import threading

        self.note(f"waved {wave.times}")
        return Waved(wave.times, threading.current_thread().name)

    @verb(moves=False, runs="beside")
    def ponder(self) -> Waved:
        """Takes until a file is there."""
        import threading

        while not Path(self.context.spec.settings["gate"]).exists():
            time.sleep(0.01)
        return Waved(0, threading.current_thread().name)

    @verb(moves=False)
    def doze(self) -> str:
        """Takes until a file is there, on the node's thread."""
        while not Path(self.context.spec.settings["gate"]).exists():
            time.sleep(0.01)
        return "awake"

    @verb(moves=False)
    def refuse(self) -> str:
        """Never does it."""
        raise RefusedError("not today: ask tomorrow")

    @verb(moves=False)
    def stumble(self) -> str:
        """Has a defect."""
        raise KeyError("shoelace")

    @verb(moves=True)
    def fall(self) -> str:
        """Has a defect that leaves the device in doubt."""
        raise KeyError("ladder")

    @verb(moves=False)
    def die(self) -> str:
        """Ends the process."""
        os._exit(7)

    @verb(moves=False)
    def chatter(self) -> str:
        """Says too much."""
        return "x" * 2_000_000

    @verb(moves=False)
    def mumble(self) -> str:
        """Says what is no text."""
        return "\ud800"


class Works(NodeBehaviour):
    """Does forty parts of something."""

    def configure(self) -> None:
        self._done = 0
        self.context.create_timer(0.01, self._work, name="work")

    def _work(self) -> None:
        self._done = min(40, self._done + 1)
        self.context.progress("parts", self._done, 40, unit="parts")
