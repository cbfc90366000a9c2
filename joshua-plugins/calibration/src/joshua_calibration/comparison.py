"""Comparison of file and servos: every difference of one arm, by joint, with the remedy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from joshua.api.calibration import ArmCalibration, MotorCalibration

from joshua_calibration.other_arms import fitting_entry
from joshua_calibration.target import CalibrationTarget, StoredMotor


@dataclass(frozen=True)
class Comparison:
    """Result of a comparison.

    Attributes:
        identity: of the device; calibrated_at: of the file's calibration.
        rows: one line for each joint.
        problems: differences; remedy: what to do about them, as lines.
    """

    node_name: str
    identity: str
    calibrated_at: str
    rows: tuple[str, ...]
    problems: tuple[str, ...]
    remedy: tuple[str, ...] = ()


def compare(
    node_name: str,
    calibration: ArmCalibration | None,
    target: CalibrationTarget,
    *,
    interrupted: bool,
    source: str = "",
    overrides: Sequence[str] = (),
) -> Comparison:
    """Compare the calibration of a file with that of an open device, without writing.

    Args:
        interrupted: whether a calibration of the arm was interrupted.
        source: configuration whose other arms, and files beside it, may have the values of the device;
            overrides: its ``--set`` options.

    Raises:
        DeviceError: the device does not reply.
    """
    identity = target.identity
    note = ["a calibration was interrupted while it was written"] if interrupted else []
    recover = "Run the command with --recover instead of --check"
    if calibration is None:
        problems = [*note, "the file contains no calibration of this arm"]
        remedy = recover if interrupted else "Calibrate it, or import one"
        return Comparison(node_name, identity, "", (), tuple(problems), (f"{remedy}.",))
    problems = note
    fit = None
    remedy = recover if interrupted else "Calibrate the arm again, or include the file that belongs to it"
    if calibration.device_identity and identity and calibration.device_identity != identity:
        problems.append(f"the calibration was made for {calibration.device_identity}, and this is {identity}")
        remedy = remedy if interrupted else "Connect the other arm, or include the calibration of this one"
    stored = target.stored()
    held = {m.id: v for m, v in zip(target.motors, stored, strict=True)} if stored is not None else None
    problems += target.misfits(calibration)
    rows = []
    for motor in target.motors:
        wanted = calibration.motor(motor.id)
        if wanted is None:
            problems.append(f"{motor.joint_name} (id {motor.id}) is not in the file")
            continue
        differences = _differences(wanted, held[motor.id]) if held is not None else []
        problems += [f"{wanted.joint_name} (id {wanted.id}): {text}" for text in differences]
        rows.append(_row(wanted, differences))
    if problems and held is not None and not interrupted:
        fit = fitting_entry(source, overrides, node_name, lambda other: _has_values(other, held))
        if fit is not None:
            problems.append(fit.cause)
    known = {motor.id for motor in target.motors}
    problems += [
        f"{m.joint_name} (id {m.id}) is not on the bus" for m in calibration.motors if m.id not in known
    ]
    lines = (f"{remedy}.",) if fit is None else fit.remedy
    return Comparison(
        node_name,
        identity,
        calibration.calibrated_at,
        tuple(rows),
        tuple(problems),
        lines if problems else (),
    )


def comparison_text(found: Comparison) -> str:
    """Return the comparison as text."""
    head = f"{found.node_name} ({found.identity or 'no identity'})"
    if found.calibrated_at:
        head += f", calibrated at {found.calibrated_at}"
    lines = [f"{'DIFFERS' if found.problems else 'EQUAL'}  {head}", *(f"  {row}" for row in found.rows)]
    lines += [f"  ! {problem}" for problem in found.problems]
    lines += [f"  {line}" for line in found.remedy]
    return "\n".join(lines) + "\n"


def _has_values(calibration: ArmCalibration, held: Mapping[int, StoredMotor]) -> bool:
    values = {
        motor.id: StoredMotor(motor.homing_offset, motor.range_min, motor.range_max)
        for motor in calibration.motors
    }
    return values == held


def _differences(wanted: MotorCalibration, held: StoredMotor) -> Sequence[str]:
    return [
        f"{name} is {getattr(wanted, name)} in the file and {getattr(held, name)} in the servo"
        for name in ("homing_offset", "range_min", "range_max")
        if getattr(wanted, name) != getattr(held, name)
    ]


def _row(motor: MotorCalibration, differences: Sequence[str]) -> str:
    sign, inverted = "!" if differences else "=", "  inverted" if motor.inverted else ""
    return (
        f"{sign} {motor.id:>3}  {motor.joint_name:<16} offset {motor.homing_offset:>5}  "
        f"range {motor.range_min:>4} to {motor.range_max:>4}{inverted}"
    )
