"""MODE_CALIBRATION: actuators that can be calibrated, and a name for the file that is written."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.config.checks import Context
from joshua.config.checks.device_table import block_of
from joshua.modes.queries import lacks
from joshua.modes.services import SIMULATION
from joshua.modes.spec import ModeSpec
from joshua.plan import Diagnostic

# Mock motors have their zero by definition, and nothing that a hand could move.
_NOT_CALIBRATABLE = ("mock_motor_config",)


def check(context: Context) -> Iterator[Diagnostic]:
    """Asks for an actuator with a zero to find, and for the robot's id."""
    entries = context.graph.actuators
    blocks = [block_of(entry.owner)[0] for entry in entries]
    if not any(block not in _NOT_CALIBRATABLE for block in blocks):
        virtual = bool(entries)
        yield lacks(
            context,
            "mode-lacks-actuator",
            "an actuator to calibrate" + (", and mock motors have nothing to calibrate" if virtual else ""),
            "robot.actions",
            found=", ".join(dict.fromkeys(blocks)),
            allowed=(
                "sts3215_config",
                "dynamixel_config",
                "spike_motor_config",
                "sim_config",
                "plugin_config",
            ),
            remedy="Add robot { actions { ... } } with the actuator's block",
        )
    if not context.config.general.id:
        yield lacks(
            context,
            "mode-lacks-field",
            "general.id, after which the calibration file is named",
            "general.id",
            position=context.block_position("general"),
            remedy='Add id: "joshua-arm-001" to general',
        )


SPEC = ModeSpec(
    "MODE_CALIBRATION",
    check,
    services=(SIMULATION,),
    blocks=("calibration_run",),
    works_uncalibrated=True,
    run="joshua_calibration.run:run_calibration",
)
