"""MODE_CALIBRATION: requires actuators that can be calibrated, and a name for the file."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.api.modes import SIMULATION, Context, ModeSpec, lacks
from joshua.tools import Diagnostic, calibratable_blocks, device_block


def check(context: Context) -> Iterator[Diagnostic]:
    """Require an actuator that can be calibrated, and the robot's id."""
    entries = context.graph.actuators
    blocks = [device_block(entry.owner) for entry in entries]
    if all(rule.virtual and not rule.simulated for _, _, rule in blocks):
        virtual = bool(entries)
        yield lacks(
            context,
            "mode-lacks-actuator",
            "an actuator to calibrate" + (", and mock motors have nothing to calibrate" if virtual else ""),
            "robot.actions",
            found=", ".join(dict.fromkeys(name for name, _, _ in blocks)),
            allowed=calibratable_blocks(),
            remedy="Add robot { actions { ... } } with the actuator's block",
        )
    if not context.config.general.id:
        yield lacks(
            context,
            "mode-lacks-field",
            "general.id, after which the calibration file is named",
            "general.id",
            position=context.position("general"),
            remedy='Add id: "joshua-arm-001" to general',
        )


SPEC = ModeSpec(
    "MODE_CALIBRATION",
    check,
    services=(SIMULATION,),
    blocks=("calibration_run",),
    works_uncalibrated=True,
    recalibrates=True,
    run="joshua_calibration.run:run_calibration",
)
