"""The driver of the clamp."""

from collections.abc import Sequence

import numpy as np
from joshua.api import Actuator, ActuatorContext, DeviceError, FloatArray, JointReading

from acme_bench.link import ask, goal
from acme_bench.safe_stop import ClampStop
from acme_bench.settings import ClampSettings, port_of


class Clamp(Actuator):
    """One joint, ``clamp``: 0 when closed."""

    settings: ClampSettings
    velocity_max_rad_s = 2.0
    _torque = False

    def __init__(self, settings: ClampSettings, context: ActuatorContext | None = None) -> None:
        super().__init__(settings, context)
        self._port = port_of(settings)

    @property
    def connected(self) -> bool:
        """Whether the port is open."""
        return self._port.is_open

    def connect(self) -> None:
        """Open the port and ask the clamp for its state. Raises DeviceError."""
        self._port.open()
        try:
            self._torque = ask(self._port, "S").torque
        except BaseException:
            self._port.close()
            raise

    def read(self) -> JointReading:
        """Read position and speed."""
        self.require_connected("read")
        state = ask(self._port, "S")
        return JointReading(
            self.context.clock.now_ns(),
            np.array([state.position_rad]),
            np.array([state.velocity_rad_s]),
            np.zeros(1),
        )

    def enable(self) -> None:
        """Enable torque with the goal at the present position, which is set first."""
        self.hold()
        self._torque = ask(self._port, "T1").torque

    def write(self, goal_rad: FloatArray) -> FloatArray:
        """Command a position and return it after clamping."""
        self.require_connected("write")
        position = self.limits.clip(self.checked_goal(goal_rad))
        if not self._torque:
            raise DeviceError("the clamp has no torque: call enable first")
        ask(self._port, goal(position[0]))
        return position

    def hold(self) -> None:
        """Stop at the present position."""
        self.require_connected("hold")
        ask(self._port, goal(ask(self._port, "S").position_rad))

    def release(self) -> None:
        """Disable torque; no effect on a closed device."""
        if self.connected:
            self._torque = ask(self._port, "T0").torque

    def read_torque(self) -> dict[str, bool]:
        """Read back whether the joint has torque."""
        self.require_connected("read_torque")
        return {"clamp": ask(self._port, "S").torque}

    def safe_stop_request(
        self, action: str, *, park_pose_rad: Sequence[float] = (), timeout_s: float = 2.0
    ) -> ClampStop:
        """Say how the guardian reaches the clamp if this driver dies."""
        entry = self._port.entry
        return ClampStop(
            action,
            timeout_s=timeout_s,
            path=entry.path,
            serial_number=entry.serial_number,
            baudrate=self._port.baudrate,
        )

    def disconnect(self) -> None:
        """Close the port; the node has brought the joint into its safe state before."""
        self._port.close()
        self._torque = False
