"""Ctrl-C during a stop: what it says, and how often it takes to kill the nodes."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from enum import Enum

from joshua.plan import ActuatorFacts, NodeSpec

#: Two further signals within this time kill the nodes.
REPEAT_S = 2.0

HOLD, PARK = "HOLD", "PARK_THEN_RELEASE"


class Press(Enum):
    """What a signal asks for."""

    STOP = "stop cleanly"
    AGAIN = "the first of two further signals"
    FORCE = "kill the nodes at once"
    NOTHING = "nothing"


class RepeatedStop:
    """Counts the signals of one run.

    The first one asks for a clean stop. Two further ones within ``REPEAT_S`` kill the nodes. A closed
    terminal (SIGHUP) stops a run but never counts as a repetition: no person asks for haste by it.
    """

    def __init__(self) -> None:
        self._begun = False
        self._further_s = float("-inf")

    def press(self, number: int, now_s: float) -> Press:
        """Takes a signal at a time in seconds."""
        if not self._begun:
            self._begun = True
            return Press.STOP
        if number == signal.SIGHUP:
            return Press.NOTHING
        if now_s - self._further_s <= REPEAT_S:
            return Press.FORCE
        self._further_s = now_s
        return Press.AGAIN


class StopNotice:
    """What a stop does to the joints that may have torque, in words.

    Args:
        specs: nodes of the run.
        limit_s: time after which nodes that have not ended are killed.
        energised: whether the run has enabled torque.

    Attributes:
        parking: full names of the actuators that park.
    """

    def __init__(self, specs: Sequence[NodeSpec], limit_s: float, *, energised: bool) -> None:
        self._limit_s = limit_s
        self._park_s = 0.0
        self.parking: list[str] = []
        self._holding: list[str] = []
        for spec in specs if energised else ():
            facts = spec.facts
            if not isinstance(facts, ActuatorFacts) or facts.safe_stop is None or facts.dry_run:
                continue
            if not spec.subscriptions:
                continue  # nothing commands it, so it never gets torque
            if facts.safe_stop.state == PARK:
                self.parking.append(spec.full_name)
                self._park_s = max(self._park_s, facts.safe_stop.timeout_s)
            elif facts.safe_stop.state == HOLD:
                self._holding.append(spec.full_name)

    def first(self, number: int) -> str:
        """The line of the first signal."""
        doing = f"stopping, up to {_duration(self._limit_s)}"
        if self.parking:
            doing = f"parking {', '.join(self.parking)}, up to {_duration(self._park_s)}"
        return f"{doing}; {_key(number)} twice more within {REPEAT_S:g} s {self.forced}"

    def again(self, number: int) -> str:
        """The line of the first of two further signals."""
        return f"{_key(number)} once more within {REPEAT_S:g} s {self.forced}"

    @property
    def forced(self) -> str:
        """What the last one does."""
        does = "kills the nodes at once"
        if self.parking:
            does = f"stops at once and drops {', '.join(self.parking)}"
        if self._holding:
            does += f", while {', '.join(self._holding)} {'holds' if len(self._holding) == 1 else 'hold'}"
        return does


def _duration(time_s: float) -> str:
    """A time for a person: an upload may take days."""
    if time_s < 120:
        return f"{time_s:.0f} s"
    return f"{time_s / 60:.0f} min" if time_s < 7200 else f"{time_s / 3600:.0f} h"


def _key(number: int) -> str:
    return "Ctrl-C" if number == signal.SIGINT else "SIGTERM"
