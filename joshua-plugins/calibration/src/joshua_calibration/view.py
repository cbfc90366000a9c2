"""View of a calibration as plain values, shared by the terminal and the page."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Step(str, Enum):
    """Steps of one arm, in order."""

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
        present_deg, low_deg, high_deg: about the middle pose, or of the encoder before it is taken; None if
            unknown.
        coverage: share of the range that was measured, 0 to 1; low_found, high_found: the end is certain.
        note: remark about the joint; "" for none.
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
        instruction: what to do now; message: refusal or event, "" for none.
        is_problem: whether the message needs an action.
        active: index of the joint to move; None for none.
        commands: available requests: ``confirm``, ``back``, ``repeat``.
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
