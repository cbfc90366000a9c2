"""The state of an arm as data of ``diagnostic_msgs/msg/DiagnosticArray``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from joshua.devices.servo.counters import BusCounters
from joshua.devices.servo.feedback import Feedback
from joshua.devices.servo.watch import HealthWatch

OK, WARN, ERROR, STALE = range(4)


@dataclass(frozen=True)
class DiagnosticStatus:
    """One row; the fields are those of ``diagnostic_msgs/msg/DiagnosticStatus``."""

    level: int
    name: str
    message: str
    hardware_id: str
    values: Mapping[str, str] = field(default_factory=dict)


def joint_rows(
    names: Sequence[str],
    ids: Sequence[int],
    readings: Sequence[Feedback],
    watch: HealthWatch,
    hardware_id: str,
) -> list[DiagnosticStatus]:
    """One row for each joint: temperature, voltage, current, load and the servo's status bits."""
    rows = []
    for index, (name, servo_id, reading) in enumerate(zip(names, ids, readings, strict=True)):
        warning = watch.warning(index, reading)
        fault = reading.status & ~watch.status.voltage
        rows.append(
            DiagnosticStatus(
                ERROR if fault else WARN if warning else OK,
                name,
                warning or "in order",
                f"{hardware_id} id {servo_id}",
                {
                    "position_ticks": str(reading.position),
                    "speed_ticks_s": f"{reading.speed:.0f}",
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
    """The row of the bus: what was lost, corrupt or late since it was opened.

    Args:
        lost_before: replies lost up to the last row; more of them since then are a warning.
    """
    lost = sum(counters.lost.values())
    worst = max(counters.lost, key=lambda servo_id: counters.lost[servo_id], default=None)
    message = "in order"
    if lost > lost_before:
        message = (
            f"{lost - lost_before} replies lost since the last report, most of id {worst}: check its cable"
        )
    return DiagnosticStatus(
        WARN if lost > lost_before else OK,
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
