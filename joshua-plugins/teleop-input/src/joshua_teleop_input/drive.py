"""Conversion of user input to joint commands: gate, shaping, goals and timing."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from joshua.api import JointRange

from joshua_teleop_input.gate import Gate
from joshua_teleop_input.jog import Jog
from joshua_teleop_input.settings import ControlSettings

#: Without an enable button, commands continue for this time after the last motion.
TAIL_S = 0.5

Value = Callable[[str], float]


class Drive:
    """Turns states of an input device into commands; not thread-safe.

    Commands are sent only while driving is on, and then for every driven joint. An axis or key that is
    deflected when driving starts or the device appears has no effect until it was centred.

    Args:
        controls: mapping of inputs to joints.
        gate: enables driving.
        jog: holds the goals.
        shape: maps a raw deflection to a share of the speed.
        release: name of the button that returns control to another commander; "" for none.

    Attributes:
        returns_control: the button was pressed; cleared by the sender of the message.
    """

    def __init__(
        self,
        controls: Sequence[ControlSettings],
        gate: Gate,
        jog: Jog,
        shape: Callable[[float], float],
        release: str = "",
    ) -> None:
        self.gate, self.jog = gate, jog
        self._release_button, self._release_was_up = release, False
        self.returns_control = False
        self._controls = tuple(controls)
        self._shape = shape
        self._centred = [False] * len(self._controls)
        self._deflection = [0.0] * len(self._controls)
        self._sending = False
        self._last_motion_s = float("-inf")

    @property
    def sending(self) -> bool:
        """Whether commands are being sent."""
        return self._sending

    @property
    def moving(self) -> dict[str, float]:
        """Speeds in rad/s of the moving joints."""
        return self._velocity() if self._sending else {}

    @property
    def deflections(self) -> list[float]:
        """Deflection of each control, -1 to 1, even while driving is off."""
        return list(self._deflection)

    def take(self, value: Value) -> bool:
        """Update from a device state; return whether a motion started, ended or reversed.

        Args:
            value: returns the value of an axis, button or key by name.
        """
        before = (self.gate.active, self._signs())
        self.gate.update(lambda name: value(name) >= 0.5)
        for index, control in enumerate(self._controls):
            raw = value(control.positive) - (value(control.negative) if control.negative else 0.0)
            deflection = self._shape(min(max(raw, -1.0), 1.0))
            self._centred[index] |= deflection == 0.0
            self._deflection[index] = deflection if self._centred[index] else 0.0
        if self._release_button:
            down = value(self._release_button) >= 0.5
            if down and self._release_was_up:
                self.gate.switch_off()
                self._centre()
                self.returns_control = True
            self._release_was_up = not down
        return before != (self.gate.active, self._signs())

    def release(self) -> bool:
        """Treat all controls as released and switch driving off: the device is lost or stale.

        Returns whether anything was moving or switched on.
        """
        was = self.gate.active or any(self._deflection)
        self.gate.close()
        self._release_was_up = False
        self._centre()
        return was

    def command(self, now_s: float) -> dict[str, float] | None:
        """Return the goals to send, in rad by joint; None while driving is off."""
        if not self._wanted(now_s) or not self.jog.ready(now_s):
            # The last goal stays valid: the follower holds the arm there.
            self._sending = False
            self.jog.end()
            return None
        if not self._sending:
            self._sending = True
            self.jog.begin()
        return self.jog.advance(self._velocity(), now_s)

    def _centre(self) -> None:
        self._centred = [False] * len(self._controls)
        self._deflection = [0.0] * len(self._controls)
        self._last_motion_s = float("-inf")

    def _wanted(self, now_s: float) -> bool:
        if not self.gate.active:
            return False
        if any(self._deflection):
            self._last_motion_s = now_s
        return self.gate.has_buttons or now_s - self._last_motion_s <= TAIL_S

    def _signs(self) -> tuple[int, ...]:
        return tuple((value > 0) - (value < 0) for value in self._deflection)

    def _velocity(self) -> dict[str, float]:
        """Return the speed of each joint; controls of one joint add up, limited to the fastest of them."""
        total: dict[str, float] = {}
        fastest: dict[str, float] = {}
        for control, deflection in zip(self._controls, self._deflection, strict=True):
            total[control.joint] = total.get(control.joint, 0.0) + control.speed_rad_s * deflection
            fastest[control.joint] = max(fastest.get(control.joint, 0.0), abs(control.speed_rad_s))
        return {
            joint: min(max(speed, -fastest[joint]), fastest[joint])
            for joint, speed in total.items()
            if speed != 0.0
        }


def limits_of(joints: Sequence[JointRange]) -> dict[str, tuple[float, float]]:
    """Return the minimum and maximum angle by joint."""
    return {joint.name: (joint.min_rad, joint.max_rad) for joint in joints}
