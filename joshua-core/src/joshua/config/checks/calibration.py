"""Calibrations belong to actuators of the file and cover their motors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from joshua.config.checks.context import Context
from joshua.config.checks.device_table import block_of
from joshua.plan import Diagnostic
from joshua.plan.graph import NodeEntry
from joshua.schema import calibration_pb2 as calibration_pb
from joshua.textproto.nearest import nearest_first


def check(context: Context) -> Iterator[Diagnostic]:
    """Compare each calibration with the actuator that it names."""
    actuators = {entry.node.node_name: entry for entry in context.graph.entries if entry.is_actuator}
    first: dict[str, str] = {}
    for index, arm in enumerate(context.config.calibration.arms):
        path = f"calibration.arms[{index}]"
        yield from _joints(context, path, arm)
        if not arm.node_name:
            continue
        other = first.setdefault(arm.node_name, path)
        if other != path:
            message = f"{arm.node_name} is calibrated twice, and only one calibration can hold"
            related = context.see(f"{other}.node_name", "first calibration")
            yield context.error("calibration-duplicate", message, f"{path}.node_name", related=related)
        elif arm.node_name not in actuators:
            # The robot's file has all its arms, this configuration maybe only some.
            make = context.note if _is_shared(context, path) else context.warning
            yield make(
                "calibration-unknown-node",
                f"No actuator of this file is called {arm.node_name}, so this calibration has no effect",
                f"{path}.node_name",
                allowed=tuple(f'"{name}"' for name in nearest_first(arm.node_name, actuators)),
            )
        else:
            yield from _motors(context, path, arm, actuators[arm.node_name])


def _is_shared(context: Context, path: str) -> bool:
    position = context.position(f"{path}.node_name")
    return position is not None and position.file == context.loaded.calibration_file


def _joints(context: Context, path: str, arm: calibration_pb.ArmCalibration) -> Iterator[Diagnostic]:
    first: dict[str, int] = {}
    for index, motor in enumerate(arm.motors):
        name = motor.joint_name
        if name and first.setdefault(name, index) != index:
            field = f"{path}.motors[{index}].joint_name"
            message = f"Two motors of one arm move the joint {name}; joints are matched by name"
            related = context.see(f"{path}.motors[{first[name]}].joint_name", "first use of this name")
            yield context.error("duplicate-joint-name", message, field, related=related)


def _motors(
    context: Context, path: str, arm: calibration_pb.ArmCalibration, entry: NodeEntry
) -> Iterator[Diagnostic]:
    """Check that the calibration has exactly the ids of the bus."""
    name, block = block_of(entry.owner)
    listed: Sequence[int] = getattr(block, "motor_ids", ()) if name != "plugin_config" else ()
    bus = dict.fromkeys(listed)
    if not bus or not arm.motors:
        return
    calibrated = {motor.id for motor in arm.motors}
    bus_path = f"{entry.owner_path}.{name}.motor_ids"
    related = context.see(bus_path, f"motors of {arm.node_name}") or context.see(f"{bus_path}[0]", "motors")
    for index, motor in enumerate(arm.motors):
        if motor.id not in bus:
            yield context.error(
                "calibration-unknown-motor",
                f"{arm.node_name} has no motor {motor.id}, so the calibration is that of another arm",
                f"{path}.motors[{index}].id",
                found=str(motor.id),
                allowed=tuple(str(number) for number in bus),
                related=related,
            )
    absent = [str(number) for number in bus if number not in calibrated]
    # Unknown and duplicate ids are reported separately, with a remedy that also fixes missing ones.
    if absent and calibrated <= set(bus) and len(calibrated) == len(arm.motors):
        motors = f"motor{'s' if len(absent) > 1 else ''} {', '.join(absent)}"
        yield context.error(
            "calibration-incomplete",
            f"The calibration of {arm.node_name} lacks {motors}",
            f"{path}.motors",
            position=context.position(path),
            found=f"{len(arm.motors)} motor{'s' if len(arm.motors) > 1 else ''}: "
            + ", ".join(str(motor.id) for motor in arm.motors),
            related=related,
        )
