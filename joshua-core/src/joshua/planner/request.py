"""The request of the user: a file, changes to it, and the purpose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum


class Purpose(Enum):
    """The purpose of loading a configuration."""

    VALIDATE = "validate"
    """Only findings are requested."""
    SHOW = "show"
    """The plan is requested, but nothing will be started."""
    LAUNCH = "launch"
    """The nodes will be started, so missing files and plugins are errors."""


@dataclass(frozen=True, eq=False, repr=False)
class Request:
    """The request of the user.

    Attributes:
        path: configuration file; overrides: ``--set`` options, in order.
        purpose: why the configuration is loaded.
        host: this machine's name in the file; "" starts the nodes that name no host.
        blocked_plugins: plugins to ignore.
        duration_s: length of the run; None: the mode decides.
        allow_uncalibrated: energise actuators without a calibration.
        dry_run: keep the torque off.
        emulate: emulators replace the devices, with separate calibrations.
        simulate: the simulation replaces actuators and cameras in the same way. With ``emulate``, it moves
            the joints of emulated ones.
        state_home: folder for state files of this user's programs, such as calibrations of virtual devices.
        physics_socket: socket of the simulation for emulated buses; "" if none is coupled.
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
        """Whether nodes will be started."""
        return self.purpose is Purpose.LAUNCH
