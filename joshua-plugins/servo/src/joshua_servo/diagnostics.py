"""The state of an arm and its bus as rows of diagnostics."""

from __future__ import annotations

from collections.abc import Sequence

from joshua.api import DiagnosticStatus, FloatArray

from joshua_servo.counters import BusCounters
from joshua_servo.feedback import Feedback
from joshua_servo.watch import HealthWatch


def joint_rows(
    names: Sequence[str],
    ids: Sequence[int],
    readings: Sequence[Feedback],
    motion: tuple[FloatArray, FloatArray],
    watch: HealthWatch,
    hardware_id: str,
) -> list[DiagnosticStatus]:
    """One row for each joint: temperature, voltage, current, load and the servo's status bits.

    Args:
        motion: positions in rad and velocities in rad/s of the readings, shape (N,).
    """
    rows = []
    for index, (name, servo_id, reading) in enumerate(zip(names, ids, readings, strict=True)):
        warning = watch.warning(index, reading)
        fault = reading.status & ~watch.status.voltage
        rows.append(
            DiagnosticStatus(
                DiagnosticStatus.ERROR
                if fault
                else DiagnosticStatus.WARN
                if warning
                else DiagnosticStatus.OK,
                name,
                warning or "in order",
                f"{hardware_id} id {servo_id}",
                {
                    "position_rad": f"{motion[0][index]:.4f}",
                    "velocity_rad_s": f"{motion[1][index]:.3f}",
                    "load": f"{reading.load:+.3f}",
                    "voltage_v": f"{reading.voltage_v:.1f}",
                    "temperature_c": str(reading.temperature_c),
                    "current_a": f"{reading.current_a:.3f}",
                    "status_bits": f"0x{reading.status:02x}",
                },
            )
        )
    return rows


def bus_row(counters: BusCounters, lost_before: int, hardware_id: str) -> DiagnosticStatus:
    """The row of the bus: lost, corrupt and late replies since it was opened.

    Args:
        lost_before: lost replies up to the last row. New ones since then are a warning.
    """
    lost = sum(counters.lost.values())
    worst = max(counters.lost, key=lambda servo_id: counters.lost[servo_id], default=None)
    message = "in order"
    if lost > lost_before:
        message = (
            f"{lost - lost_before} replies lost since the last report, mostly from id {worst}: check its "
            "cable"
        )
    return DiagnosticStatus(
        DiagnosticStatus.WARN if lost > lost_before else DiagnosticStatus.OK,
        "bus",
        message,
        hardware_id,
        {
            "requests": str(counters.requests),
            "retries": str(counters.retries),
            "lost_replies": str(lost),
            "corrupt_replies": str(counters.corrupt),
            "stale_replies": str(counters.stale),
        },
    )
