"""The devices of a configuration: its drivers open and check them as a run would, and energise nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from joshua.cli.doctor.finding import Finding, Level
from joshua.cli.exit_codes import ExitCode
from joshua.devices.actuator import Actuator
from joshua.devices.context import ActuatorContext
from joshua.devices.errors import DeviceBusy, DeviceError
from joshua.node.implementation import load_implementation
from joshua.plan import ActuatorFacts, NodeKind
from joshua.plugins.targets import TargetError

if TYPE_CHECKING:
    from joshua.cli.doctor.parts import NodeCheck
    from joshua.plan import NodeSpec
    from joshua.planner.pipeline import PipelineResult

NAME = "devices"
WARN = 1  # of diagnostic_msgs/msg/DiagnosticStatus; above it are errors


def check_configuration(
    result: PipelineResult, *, opens: bool, further: Sequence[NodeCheck] = ()
) -> Iterator[Finding]:
    """One finding for each error of the file; else, where devices may be opened, some for each actuator."""
    for diagnostic in result.errors:
        place = f"{diagnostic.position}: " if diagnostic.position else ""
        missing = diagnostic.code in ("plugin-missing", "extra-missing")
        yield Finding(
            Level.ERROR,
            "configuration",
            diagnostic.field_path or "file",
            f"{place}{diagnostic.message}",
            diagnostic.remedy,
            ExitCode.NOT_INSTALLED if missing else ExitCode.INVALID,
        )
    if result.plan is None or not opens:
        return
    for spec in result.plan.nodes:
        if spec.kind is NodeKind.ACTUATOR:
            yield from check_actuator(spec, further)


def check_actuator(spec: NodeSpec, further: Sequence[NodeCheck] = ()) -> Iterator[Finding]:
    """Opens an actuator with its driver, which compares motors, EEPROM and calibration; reads it once."""
    try:
        implementation, settings = load_implementation(spec, Actuator)
    except TargetError as error:
        yield Finding(Level.ERROR, NAME, spec.full_name, str(error), code=ExitCode.NOT_INSTALLED)
        return
    actuator: Actuator = implementation(settings, ActuatorContext(spec.facts_as(ActuatorFacts)))
    try:
        actuator.connect()
        actuator.read()
        findings = [*_diagnosed(spec, actuator), *_advice(spec, settings)]
        for check in further:
            findings += check(spec, settings)
        yield from findings or [Finding(Level.OK, NAME, spec.full_name, _summary(actuator))]
    except DeviceBusy as error:
        yield _busy(spec, error)
    except DeviceError as error:
        yield Finding(Level.ERROR, NAME, spec.full_name, str(error))
    finally:
        actuator.disconnect()


def _busy(spec: NodeSpec, error: DeviceBusy) -> Finding:
    from joshua.cli.running import node_that_holds

    if running := node_that_holds(error.processes):
        return Finding(Level.NOTE, NAME, spec.full_name, f"was not looked at: {running}")
    return Finding(Level.ERROR, NAME, spec.full_name, str(error))


def _diagnosed(spec: NodeSpec, actuator: Any) -> Iterator[Finding]:
    """Rows of the driver's diagnostics that are not in order."""
    for row in actuator.diagnostics():
        if row.level < WARN:
            continue
        values = [f"{row.values[name]} {unit}" for name, unit in _SHOWN if name in row.values]
        figures = f" ({', '.join(values)})" if values else ""
        level = Level.WARNING if row.level == WARN else Level.ERROR
        yield Finding(
            level,
            NAME,
            f"{spec.full_name} {row.name}",
            f"{row.message}{figures}",
            "look for the cause: a blocked joint, heat, the supply, a loose cable",
        )


_SHOWN = (("temperature_c", "°C"), ("voltage_v", "V"))


def _advice(spec: NodeSpec, settings: Any) -> Iterator[Finding]:
    if hasattr(settings, "calibration") and settings.calibration is None:
        yield Finding(
            Level.WARNING,
            NAME,
            spec.full_name,
            "is not calibrated, so it gets no torque",
            "run a MODE_CALIBRATION configuration, such as the preset calibrate_so_arm100",
        )


def _summary(actuator: Any) -> str:
    names = ", ".join(actuator.joint_names)
    rows = actuator.diagnostics()
    joints = [row for row in rows if "temperature_c" in row.values]
    if not joints:
        return f"answers: {names}"
    hottest = max(float(row.values["temperature_c"]) for row in joints)
    volts = [float(row.values["voltage_v"]) for row in joints if "voltage_v" in row.values]
    supply = f", {min(volts):.1f} V at least" if volts else ""
    return f"answers: {names}; {hottest:.0f} °C at most{supply}"
