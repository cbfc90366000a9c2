"""The state of a hub as rows of ``/diagnostics`` (motors, battery, link) and as BatteryState."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from joshua.api import DiagnosticStatus, JointReading
from joshua.messages import message_class
from joshua.messages.make import header

from joshua_spike.lines import HubState
from joshua_spike.pybricks import Status
from joshua_spike.session import Counters

#: Voltages of the SPIKE hub's two lithium cells: the firmware's warning threshold, and full charge.
LOW_MV, FULL_MV = 6_800, 8_300

BATTERY_STATE = "sensor_msgs/msg/BatteryState"


def joint_rows(
    names: Sequence[str], ports: Sequence[str], reading: JointReading, state: HubState, hardware_id: str
) -> list[DiagnosticStatus]:
    """Return one row for each motor, as last read."""
    torque = "holding" if state.holding else "on" if state.energised else "off"
    return [
        DiagnosticStatus(
            DiagnosticStatus.OK,
            name,
            "in order",
            f"{hardware_id} port {port}",
            {
                "position_rad": f"{reading.position_rad[index]:+.4f}",
                "velocity_rad_s": f"{reading.velocity_rad_s[index]:+.3f}",
                "effort_nm": f"{reading.effort[index]:+.3f}",
                "motor_deg": str(state.angles_deg[index]),
                "torque": torque,
            },
        )
        for index, (name, port) in enumerate(zip(names, ports, strict=True))
    ]


def battery_row(state: HubState, status: Status, hardware_id: str) -> DiagnosticStatus:
    """Return the row of the battery: voltage and the state reported by the firmware."""
    level, message = DiagnosticStatus.OK, "in order"
    if status & (Status.BATTERY_CRITICAL | Status.SHUTDOWN):
        level, message = DiagnosticStatus.ERROR, "the hub is about to switch off: charge it"
    elif status & Status.BATTERY_HIGH_CURRENT:
        level, message = DiagnosticStatus.WARN, "the current is high: check whether a motor is blocked"
    elif status & Status.BATTERY_LOW or state.battery_mv < LOW_MV:
        level, message = DiagnosticStatus.WARN, "low: charge the hub soon"
    percent = _charge(state) * 100
    values = {"voltage_v": f"{state.battery_mv / 1000:.2f}", "charge_estimate_percent": f"{percent:.0f}"}
    return DiagnosticStatus(level, "battery", message, hardware_id, values)


def battery_message(state: HubState, stamp_ns: int, frame_id: str, hardware_id: str) -> Any:
    """Return a ``BatteryState``; values that the hub does not measure are NaN or unknown."""
    kind = message_class(BATTERY_STATE)
    return kind(
        header=header(frame_id, stamp_ns),
        voltage=state.battery_mv / 1000,
        temperature=math.nan,
        current=math.nan,
        charge=math.nan,
        capacity=math.nan,
        design_capacity=math.nan,
        percentage=_charge(state),
        power_supply_status=kind.POWER_SUPPLY_STATUS_UNKNOWN,
        power_supply_health=kind.POWER_SUPPLY_HEALTH_UNKNOWN,
        power_supply_technology=kind.POWER_SUPPLY_TECHNOLOGY_LION,
        present=True,
        cell_voltage=np.empty(0, np.float32),
        cell_temperature=np.empty(0, np.float32),
        location="",
        serial_number=hardware_id,
    )


def _charge(state: HubState) -> float:
    """Estimate the charge from the voltage, 0 to 1."""
    return min(max((state.battery_mv - LOW_MV) / (FULL_MV - LOW_MV), 0.0), 1.0)


def link_row(counters: Counters, before: Counters, state: HubState, hardware_id: str) -> DiagnosticStatus:
    """Return the row of the link since it was opened; losses since ``before`` are a warning."""
    worse = counters.lost > before.lost or counters.corrupt > before.corrupt
    message = "lines were lost or damaged since the last report: move closer" if worse else "in order"
    return DiagnosticStatus(
        DiagnosticStatus.WARN if worse else DiagnosticStatus.OK,
        "link",
        message,
        hardware_id,
        {
            "lines": str(counters.lines),
            "lost": str(counters.lost),
            "corrupt": str(counters.corrupt),
            "refused_by_the_hub": str(state.refused),
            "round_trip_ms": f"{counters.round_trip_s * 1e3:.1f}",
        },
    )
