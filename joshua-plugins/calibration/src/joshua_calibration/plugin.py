"""What this distribution provides to the host: MODE_CALIBRATION; it brings a command, too."""

from __future__ import annotations

from joshua.api import hookimpl
from joshua.api.specs import ModeOffer


@hookimpl
def joshua_specs() -> list[ModeOffer]:
    """Name the mode."""
    return [
        ModeOffer(
            enum_values=("MODE_CALIBRATION",),
            implementation="joshua_calibration.mode:SPEC",
            summary="zero points and ranges of motors, measured by hand",
        )
    ]
