"""The view of a calibration for a person: plain values, the same for the terminal and the page."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Step(str, Enum):
    """The steps of one arm, in their order."""

    HOMING = "homing"
    SWEEP = "sweep"
    REVIEW = "review"
    WRITE = "write"
    DONE = "done"


class JointState(str, Enum):
    """State of one joint."""

    WAITING = "waiting"
    ACTIVE = "active"
    COMPLETE = "complete"
    DONE = "done"
    REFUSED = "refused"


@dataclass(frozen=True)
class JointView:
    """One row.

    Attributes:
        present_deg, low_deg, high_deg: about the middle pose; before there is one, of the encoder. None while
            unknown.
        coverage: share of the range that was seen, 0 to 1; low_found, high_found: the ends are certain.
        note: what is remarkable about the joint; "" for nothing.
    """

    id: int
    name: str
    state: JointState
    present_deg: float | None
    low_deg: float | None
    high_deg: float | None
    coverage: float
    low_found: bool
    high_found: bool
    note: str


@dataclass(frozen=True)
class View:
    """Everything that a front end shows.

    Attributes:
        instruction: what to do now; message: what was refused or happened, "" for nothing.
        is_problem: whether the message is about something to put right.
        active: place of the joint that is to be moved; None for none.
        commands: what can be asked for now: ``confirm``, ``back``, ``repeat``.
        ready: whether ``confirm`` would be accepted.
    """

    step: Step
    instruction: str
    message: str
    is_problem: bool
    joints: tuple[JointView, ...]
    active: int | None
    commands: tuple[str, ...]
    ready: bool
