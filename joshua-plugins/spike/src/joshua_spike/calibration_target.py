"""The motors of a hub as a calibration sees them: absolute angles without torque; the hub keeps nothing."""

from __future__ import annotations

from joshua_calibration.target import CalibrationTarget, StoredMotor, TargetMotor

from joshua_spike.client import HubClient
from joshua_spike.settings import TICKS_PER_TURN, SpikeSettings, port_id


class SpikeCalibrationTarget(CalibrationTarget):
    """One hub. Its motors know their angle against a mark on the shaft, in degrees, also after a restart."""

    def __init__(self, settings: SpikeSettings) -> None:
        self._hub = HubClient(settings, hold=False)
        self._identity = ""
        self._motors = tuple(
            TargetMotor(port_id(port), f"joint_{port.lower()}", ticks_per_turn=TICKS_PER_TURN, full_turn=True)
            for port in settings.port_names
        )

    @property
    def motors(self) -> tuple[TargetMotor, ...]:
        """The motors in the order of port_names; a port's id is its place, A is 1."""
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
        """Find the hub, start its program, and check that there are motors."""
        self._hub.open()
        self._identity = f"ble:{self._hub.address}"

    def disconnect(self) -> None:
        """Close the link."""
        self._hub.close()

    def release(self) -> None:
        """Disable the torque of all motors, confirmed by the hub."""
        self._hub.order("F")

    def raw_positions(self) -> tuple[int, ...]:
        """Absolute angles as ticks of 4096 a turn; the motors themselves tell whole degrees."""
        angles = self._hub.next_state().state.angles_deg
        return tuple(round(angle % 360 * TICKS_PER_TURN / 360) % TICKS_PER_TURN for angle in angles)

    def stored(self) -> tuple[StoredMotor, ...] | None:
        """None: hub and motors store nothing, so only the file contains the calibration."""
        return None

    def store(self, motor_id: int, values: StoredMotor) -> None:
        """Do nothing: there is no place for it in the motors."""
