"""What the user asked for: a file, changes to it, and how far to go with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum


class Purpose(Enum):
    """How far a configuration is taken."""

    VALIDATE = "validate"
    """Only its findings are wanted."""
    SHOW = "show"
    """The plan is wanted, and nothing will be started."""
    LAUNCH = "launch"
    """The nodes are going to be started, which turns missing files and plugins into errors."""


@dataclass(frozen=True, eq=False, repr=False)
class Request:
    """What the user asked for.

    Attributes:
        path: configuration file; overrides: ``--set`` options, in order.
        purpose: how far to go.
        host: this machine's name in the file; "" starts the nodes that name no host.
        blocked_plugins: plugins that are left out.
        duration_s: length of the run; None leaves it to the mode.
        allow_uncalibrated: energise actuators that have no calibration.
        dry_run: do everything with torque off.
        emulate: emulators replace the devices, with calibrations of their own.
        simulate: the simulation replaces actuators and cameras, likewise; with ``emulate`` it moves the
            joints of emulated ones.
        state_home: folder of what this user's programs keep, where the calibrations of stand-ins are.
        physics_socket: where the simulation answers emulated buses; "" where none is coupled.
    """

    path: str
    overrides: Sequence[str] = ()
    purpose: Purpose = Purpose.SHOW
    host: str = ""
    blocked_plugins: Sequence[str] = ()
    duration_s: float | None = None
    allow_uncalibrated: bool = False
    dry_run: bool = False
    emulate: bool = False
    simulate: bool = False
    state_home: str = ""
    physics_socket: str = ""

    @property
    def launch(self) -> bool:
        """Whether nodes are going to be started."""
        return self.purpose is Purpose.LAUNCH
