"""The interface between a session and its displays: the board, and requests."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from joshua_calibration.view import View


class Ask(str, Enum):
    """Requests of the user."""

    CONFIRM = "confirm"
    BACK = "back"
    REPEAT = "repeat"
    QUIT = "quit"


@dataclass(frozen=True)
class Request:
    """A request of the user. ``joint`` is the index of the joint to repeat."""

    ask: Ask
    joint: int = -1


class ArmState(str, Enum):
    """State of one arm of the run."""

    WAITING = "waiting"
    ACTIVE = "active"
    DONE = "done"
    STOPPED = "stopped"


@dataclass(frozen=True)
class Board:
    """All arms of a run, and the present one.

    Attributes:
        title: name of the robot.
        arms: node name and state of each arm, in order.
        arm: index of the arm in ``view``.
        ended: outcome of the run; "" while it continues.
    """

    title: str
    arms: tuple[tuple[str, ArmState], ...]
    arm: int
    view: View
    ended: str = ""


class FrontEnd(ABC):
    """Shows the board and collects requests; called from one thread, never blocks."""

    @abstractmethod
    def show(self, board: Board) -> None:
        """Show the newest state."""

    @abstractmethod
    def requests(self) -> Sequence[Request]:
        """Return the requests since the last call."""

    @abstractmethod
    def say(self, text: str) -> None:
        """Show a permanent line."""

    @abstractmethod
    def close(self) -> None:
        """Release all resources. Idempotent."""

    @property
    @abstractmethod
    def can_ask(self) -> bool:
        """Whether this front end can still receive requests."""
