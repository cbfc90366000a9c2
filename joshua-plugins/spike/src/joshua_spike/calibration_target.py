"""Calibration target of a hub's motors: absolute angles with torque off; the hub stores nothing."""

from __future__ import annotations

from joshua_calibration.target import CalibrationTarget, StoredMotor, TargetMotor

from joshua_spike.client import HubClient
from joshua_spike.settings import TICKS_PER_TURN, SpikeSettings, port_id


class SpikeCalibrationTarget(CalibrationTarget):
    """One hub. Its motors measure the absolute angle to a mark on the shaft, in degrees."""

    def __init__(self, settings: SpikeSettings) -> None:
        self._hub = HubClient(settings, hold=False)
        self._identity = ""
        self._motors = tuple(
            TargetMotor(port_id(port), f"joint_{port.lower()}", ticks_per_turn=TICKS_PER_TURN, full_turn=True)
            for port in settings.port_names
        )

    @property
    def motors(self) -> tuple[TargetMotor, ...]:
        """Motors in the order of port_names; the id is the position of the port, A is 1."""
        return self._motors

    @property
    def identity(self) -> str:
        """Bluetooth address of the hub."""
        return self._identity

    @property
    def connected(self) -> bool:
        """Whether the hub is open."""
        return self._hub.is_open

    def connect(self) -> None:
        """Find the hub, start its program and check the motors."""
        self._hub.open()
        self._identity = f"ble:{self._hub.address}"

    def disconnect(self) -> None:
        """Close the link."""
        self._hub.close()

    def release(self) -> None:
        """Disable the torque of all motors, confirmed by the hub."""
        self._hub.order("F")

    def raw_positions(self) -> tuple[int, ...]:
        """Return absolute angles in ticks, 4096 per turn; the motors report whole degrees."""
        angles = self._hub.next_state().state.angles_deg
        return tuple(round(angle % 360 * TICKS_PER_TURN / 360) % TICKS_PER_TURN for angle in angles)

    def stored(self) -> tuple[StoredMotor, ...] | None:
        """Return None: hub and motors store nothing, so only the file contains the calibration."""
        return None

    def store(self, motor_id: int, values: StoredMotor) -> None:
        """Do nothing: the motors cannot store it."""
