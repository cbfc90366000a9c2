"""The actuator: motors on a LEGO SPIKE hub, in radians."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from joshua.api import (
    Actuator,
    ActuatorContext,
    DeviceError,
    DiagnosticStatus,
    FloatArray,
    JointReading,
)

from joshua_spike.client import DEAD_MAN_S, HubClient
from joshua_spike.diagnostics import BATTERY_STATE, battery_message, battery_row, joint_rows, link_row
from joshua_spike.errors import NotCalibrated, NotEnabled, ProgramFailed, SafetyTripped
from joshua_spike.joint_map import MAX_SPEED_RAD_S, RADIANS_PER_DEGREE, JointMap
from joshua_spike.session import Counters, StampedState
from joshua_spike.settings import SpikeSettings

if TYPE_CHECKING:
    from joshua_calibration.target import CalibrationTarget

MAX_RATE_WINDOW_S = 0.5  # after a pause, a goal is at most this many seconds of full speed away
NEWTON_METRES_PER_MNM = 1e-3


class SpikeActuator(Actuator):
    """The motors of one hub.

    The hub itself stops them if it receives no command for half a second: they hold if the plan's safe state
    is ``HOLD``, and coast otherwise. This limit depends on neither this driver nor a guardian.

    Args:
        settings: of the hub.
        context: of its node. ``allow_uncalibrated`` permits torque without a calibration, in radians about
            the marks.
    """

    settings: SpikeSettings
    velocity_max_rad_s = MAX_SPEED_RAD_S

    def __init__(self, settings: SpikeSettings, context: ActuatorContext | None = None) -> None:
        super().__init__(settings, context)
        self._map = JointMap(settings)
        self._hub = HubClient(settings, hold=self.context.facts.safe_state == "HOLD")
        self._lock = threading.RLock()
        self._enabled = False
        self._tripped = False
        self._goal = np.zeros(len(settings.port_names))
        self._target_deg: Sequence[int] = (0,) * len(settings.port_names)
        self._written_s = 0.0
        self._last: tuple[JointReading, StampedState] | None = None
        self._counted = Counters()

    @property
    def connected(self) -> bool:
        """Whether the hub is open."""
        return self._hub.is_open

    @property
    def enabled(self) -> bool:
        """Whether this driver enabled torque and, as far as it knows, torque is still on."""
        return self._enabled

    @property
    def identity(self) -> str:
        """Identity of the hub, such as ``ble:90:84:2B:00:11:22``; "" while unknown."""
        return f"ble:{self._hub.address}" if self._hub.address else ""

    @property
    def counters(self) -> Counters:
        """Link counters since it was opened."""
        return self._hub.counters

    def connect(self) -> None:
        """Find the hub, start the program unless it is running, and check the motors.

        Raises:
            DeviceError: the device is already open, or one of ``joshua_spike.errors`` with its remedy.
        """
        if self.connected:
            raise DeviceError("SpikeActuator.connect: the device is already open")
        with self._lock:
            self._hub.open(self.context.stopping)
            try:
                state = self._hub.next_state()
            except BaseException:
                self._hub.close()
                raise
            self._map = JointMap(self.settings, state.state.angles_deg)
            self._enabled = self._tripped = False
            self._last, self._counted = None, Counters()

    def read(self) -> JointReading:
        """Wait for a new state; effort is the load estimated by the hub, in N·m.

        Raises:
            DeviceDisconnected: the link or the program on the hub has ended.
            SafetyTripped: the hub has just stopped the motors; further reads work.
        """
        self.require_connected("read")
        stamped = self._hub.next_state()
        with self._lock:
            if self._enabled and stamped.state.tripped:
                self._enabled, self._tripped = False, True
                raise SafetyTripped(self._trip_text())
            reading = JointReading(
                stamped.stamp_ns,
                self._map.radians(stamped.state.angles_deg),
                self._map.directed(stamped.state.speeds_deg_s) * RADIANS_PER_DEGREE,
                self._map.directed(stamped.state.loads_mnm) * NEWTON_METRES_PER_MNM,
            )
            copies = (reading.position_rad.copy(), reading.velocity_rad_s.copy(), reading.effort.copy())
            self._last = (JointReading(stamped.stamp_ns, *copies), stamped)
        return reading

    def enable(self) -> None:
        """Enable torque at the present positions.

        Raises:
            NotCalibrated: there is no calibration, and the plan requires one.
            DeviceDisconnected: the hub does not respond.
        """
        self.require_connected("enable")
        if self.settings.calibration is None and not self.context.facts.allow_uncalibrated:
            raise NotCalibrated(
                f"{self._hub}: the motors are not calibrated, so they are not energised. Run a "
                "MODE_CALIBRATION configuration such as the preset calibrate_spike, or pass "
                "--allow-uncalibrated to drive them about their marks."
            )
        with self._lock:
            state = self._hub.order("P" if self._dry_run else "E")
            if not (state.energised or self._dry_run):
                raise DeviceError(f"{self._hub}: the motors did not enable torque. Switch the hub off and on")
            self._enabled, self._tripped = True, False
            self._remember(self._map.radians(state.angles_deg), state.angles_deg)

    def write(self, goal_rad: FloatArray) -> FloatArray:
        """Command positions, shape (N,). Return the goals after clamp, rate limit and rounding.

        The motors accept whole degrees. If the link is slower than the caller, only the newest goal is sent.

        Raises:
            ValueError: a wrong shape or a value that is not finite.
            SafetyTripped, NotEnabled: torque is off.
            DeviceDisconnected: the link or the program on the hub has ended.
        """
        self.require_connected("write")
        goal = self.checked_goal(goal_rad)
        with self._lock:
            if self._tripped:
                raise SafetyTripped(self._trip_text())
            if not self._enabled:
                raise NotEnabled(f"{self._hub}: torque is off: call enable first")
            elapsed_s = min(time.monotonic() - self._written_s, MAX_RATE_WINDOW_S)
            step = self.velocity_max_rad_s * elapsed_s
            goal = np.clip(goal, self._goal - step, self._goal + step)
            targets = self._map.degrees(goal, self._target_deg)
            if not self._dry_run:
                self._hub.follow(targets)
            self._remember(goal, targets)
            return self._map.radians(targets)

    def hold(self) -> None:
        """Hold the present positions, as long as the hub's battery lasts; no effect if torque is off.

        Raises:
            DeviceDisconnected: the hub does not respond; its dead man's switch stops the motors.
        """
        self.require_connected("hold")
        with self._lock:
            if self._enabled and not self._dry_run:
                state = self._hub.order("H")
                self._remember(self._map.radians(state.angles_deg), state.angles_deg)

    def release(self) -> None:
        """Disable the torque of all motors; no effect on a closed device.

        Raises:
            DeviceDisconnected: the hub does not confirm the release.
        """
        with self._lock:
            self._enabled = False
            if self.connected:
                try:
                    self._hub.order("F")
                except ProgramFailed:
                    return  # the firmware itself disables torque when a program ends

    def read_torque(self) -> dict[str, bool]:
        """Return whether torque is on, from the hub's next state. Raises DeviceDisconnected."""
        self.require_connected("read_torque")
        state = self._hub.next_state().state
        return dict.fromkeys(self.joint_names, state.energised or state.holding)

    def disconnect(self) -> None:
        """Close the link; the dead man's switch stops motors that were neither held nor released."""
        with self._lock:
            self._enabled = False
            self._hub.close()

    def diagnostics(self) -> Sequence[DiagnosticStatus]:
        """Return diagnostics rows for the motors, the battery and the link, as last read."""
        with self._lock:
            if self._last is None or not self.connected:
                return ()
            reading, stamped = self._last
            before, self._counted = self._counted, replace(self._hub.counters)
            names, ports, state = self.joint_names, self.settings.port_names, stamped.state
            return [
                *joint_rows(names, ports, reading, state, self.identity),
                battery_row(state, self._hub.status, self.identity),
                link_row(self._counted, before, state, self.identity),
            ]

    @property
    def further_types(self) -> tuple[str, ...]:
        """Types of further messages: the battery state."""
        return (BATTERY_STATE,)

    def further_message(self, type_name: str, frame_id: str) -> Any | None:
        """Return the last battery state."""
        del type_name  # there is one battery
        with self._lock:
            if self._last is None:
                return None
            _, stamped = self._last
            return battery_message(stamped.state, stamped.stamp_ns, frame_id, self.identity)

    def calibration_target(self) -> CalibrationTarget:
        """Return the calibration target of the motors."""
        from joshua_spike.calibration_target import SpikeCalibrationTarget

        return SpikeCalibrationTarget(self.settings)

    @property
    def _dry_run(self) -> bool:
        return self.context.facts.dry_run

    def _trip_text(self) -> str:
        return (
            f"{self._hub}: the hub stopped the motors, because it received no command for {DEAD_MAN_S:g} s. "
            "Check the link (move closer) and the program that sends the commands, then enable again"
        )

    def _remember(self, goal_rad: FloatArray, target_deg: Sequence[int]) -> None:
        self._goal, self._target_deg = goal_rad, target_deg
        self._written_s = time.monotonic()
