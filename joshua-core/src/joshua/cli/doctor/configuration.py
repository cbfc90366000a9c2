"""The devices of a configuration. Its drivers open and check them as in a run, with torque off."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from joshua.cli.doctor.result import DoctorResult, Level
from joshua.cli.exit_codes import ExitCode
from joshua.devices.context import open_driver
from joshua.devices.errors import DeviceBusy, DeviceError
from joshua.plan import NodeKind
from joshua.plugins.targets import TargetError

if TYPE_CHECKING:
    from joshua.plan import NodeSpec
    from joshua.planner.pipeline import PipelineResult

NAME = "devices"
WARN = 1  # of diagnostic_msgs/msg/DiagnosticStatus; above it are errors
_SHOWN = (("temperature_c", "°C"), ("voltage_v", "V"))


def check_configuration(
    result: PipelineResult, *, opens: bool, further: Sequence[Any] = ()
) -> Iterator[DoctorResult]:
    """One result for each error of the file; without errors, those of its actuators if ``opens``."""
    for diagnostic in result.errors:
        place = f"{diagnostic.position}: " if diagnostic.position else ""
        missing = diagnostic.code in ("plugin-missing", "extra-missing")
        yield DoctorResult(
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


def check_actuator(spec: NodeSpec, further: Sequence[Any] = ()) -> Iterator[DoctorResult]:
    """Open an actuator with its driver, which compares motors, EEPROM and calibration; read it once."""
    name = spec.full_name
    try:
        actuator: Any = open_driver(spec)
    except TargetError as error:
        yield DoctorResult(Level.ERROR, NAME, name, str(error), code=ExitCode.NOT_INSTALLED)
        return
    try:
        actuator.connect()
        actuator.read()
        results = list(_diagnosed(name, actuator))
        if getattr(actuator.settings, "calibration", spec) is None:
            remedy = "run `joshua calibrate --config FILE`"
            results.append(
                DoctorResult(Level.WARNING, NAME, name, "is not calibrated, so its torque stays off", remedy)
            )
        for check in further:
            results += check(spec, actuator.settings)
        yield from results or [DoctorResult(Level.OK, NAME, name, _summary(actuator))]
    except DeviceBusy as error:
        from joshua.cli.running import node_that_holds

        running = node_that_holds(error.processes)
        found = (Level.NOTE, f"not checked: {running}") if running else (Level.ERROR, str(error))
        yield DoctorResult(found[0], NAME, name, found[1])
    except DeviceError as error:
        yield DoctorResult(Level.ERROR, NAME, name, str(error))
    finally:
        actuator.disconnect()


def _diagnosed(name: str, actuator: Any) -> Iterator[DoctorResult]:
    """Rows of the driver's diagnostics that are not ok."""
    for row in actuator.diagnostics():
        if row.level < WARN:
            continue
        values = [f"{row.values[value]} {unit}" for value, unit in _SHOWN if value in row.values]
        figures = f" ({', '.join(values)})" if values else ""
        level = Level.WARNING if row.level == WARN else Level.ERROR
        remedy = "find the cause: a blocked joint, heat, the power supply, a loose cable"
        yield DoctorResult(level, NAME, f"{name} {row.name}", f"{row.message}{figures}", remedy)


def _summary(actuator: Any) -> str:
    names = ", ".join(actuator.joint_names)
    joints = [row.values for row in actuator.diagnostics() if "temperature_c" in row.values]
    if not joints:
        return f"replies: {names}"
    hottest = max(float(values["temperature_c"]) for values in joints)
    volts = [float(values["voltage_v"]) for values in joints if "voltage_v" in values]
    supply = f", {min(volts):.1f} V at least" if volts else ""
    return f"replies: {names}; {hottest:.0f} °C at most{supply}"
