"""Assigns ids to the motors of an arm, one at a time, in a dialogue with the person who connects them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from joshua_servo.bus_tools import AssignmentFailed, BusTools, FoundMotor
from joshua_servo.motors.dialogue import Dialogue, interrupts_deferred


@dataclass(frozen=True)
class WantedMotor:
    """A motor of the arm: its future id and the name of its joint."""

    motor_id: int
    joint: str

    def __str__(self) -> str:
        return f"{self.joint} (id {self.motor_id})"


class SetupProcedure:
    """Works from the last motor to the first: new motors have the id 1, which is given last.

    So a finished motor left on the cable is never mistaken for the next one.

    Args:
        wanted: the motors in cable order; baudrate: line speed for all of them.
    """

    def __init__(
        self, tools: BusTools, wanted: Sequence[WantedMotor], baudrate: int, dialogue: Dialogue
    ) -> None:
        self._tools = tools
        self._wanted = tuple(wanted)
        self._baudrate = baudrate
        self._dialogue = dialogue
        self.done: list[WantedMotor] = []

    @property
    def remaining(self) -> list[WantedMotor]:
        """Motors without an id, in the order of the work."""
        return sorted(
            (motor for motor in self._wanted if motor not in self.done),
            key=lambda motor: motor.motor_id,
            reverse=True,
        )

    def run(self) -> None:
        """Give every motor its id, then check the whole chain.

        Raises:
            NoAnswer: the requested motor was not connected.
            DeviceError: the port is gone.
        """
        found: list[FoundMotor] | None = self._look()
        self._take_what_is_done(found or [])
        if self._dialogue.asks:  # a motor that is already connected is not changed without a question
            found = None
        while self.remaining:
            self._give(self.remaining[0], found)
            found = None
        self._check_chain()

    def _look(self) -> list[FoundMotor]:
        return list(self._tools.scan((self._baudrate, *self._other_speeds())))

    def _other_speeds(self) -> list[int]:
        return [speed for speed in self._tools.baudrates if speed != self._baudrate]

    def _take_what_is_done(self, found: list[FoundMotor]) -> None:
        """Several motors with wanted ids were set up in an earlier run."""
        ids = {motor.motor_id: motor for motor in self._wanted}
        good = [motor for motor in found if motor.motor_id in ids and self._is_set(motor)]
        if len(found) > 1 and len(good) == len(found):
            self.done = [ids[motor.motor_id] for motor in good]
            self._dialogue.say(f"done already: {_list(self.done)}")

    def _is_set(self, motor: FoundMotor) -> bool:
        known = motor.model in self._tools.expected_models
        return motor.baudrate == self._baudrate and not motor.shared and known

    def _give(self, wanted: WantedMotor, found: list[FoundMotor] | None) -> None:
        """Wait until exactly one new motor is connected, and give it an id."""
        request = f"connect only the motor of {wanted}"
        while True:
            if found is None:
                self._dialogue.wait_for(request)
                found = self._look()
            problem = self._problem(found, wanted)
            if not problem and self._assign(found[0], wanted):
                return
            if problem:
                request = f"{problem}: connect only the motor of {wanted}"
            found = None

    def _problem(self, found: list[FoundMotor], wanted: WantedMotor) -> str:
        """Why the connected motors cannot be given an id; "" if one can."""
        if not found:
            return "no motor answers at any line speed (check the supply and the cable)"
        listing = ", ".join(f"{motor} at {motor.baudrate} bit/s" for motor in found)
        if len(found) > 1 or found[0].shared:
            return f"several motors are connected, {listing}"
        (motor,) = found
        if motor.model not in self._tools.expected_models:
            expected = " or ".join(self._tools.expected_models)
            return f"{motor} is connected, expected a {expected}"
        others = {other.motor_id: other for other in self._wanted if other != wanted}
        other = others.get(motor.motor_id)
        if other is None or not self._is_set(motor):
            return ""
        if motor.motor_id == self._tools.factory_id and other not in self.done:
            return ""  # a new motor; its id is assigned last
        if other not in self.done:
            self.done.append(other)
        return f"this motor already has the id of {other}"

    def _report_alarm(self, motor: FoundMotor, wanted: WantedMotor) -> None:
        """Say that a motor is in alarm. Its id can be set, because that needs no torque."""
        if motor.alarms:
            self._dialogue.say(
                f"warning: the motor of {wanted} is in alarm: {'; '.join(motor.alarms)}. Find the "
                "cause (a blocked joint, heat, the supply) before you start the arm"
            )

    def _assign(self, motor: FoundMotor, wanted: WantedMotor) -> bool:
        self._report_alarm(motor, wanted)
        was = f"id {motor.motor_id} at {motor.baudrate} bit/s"
        try:
            with interrupts_deferred():
                now = self._tools.assign(motor, wanted.motor_id, self._baudrate)
                self.done.append(wanted)
        except AssignmentFailed as error:
            self._dialogue.say(str(error))
            return False
        self._dialogue.say(
            f"{wanted}: changed from {was} to id {now.motor_id} at {now.baudrate} bit/s, verified "
            f"({now.model}, firmware {now.firmware})"
        )
        return True

    def _check_chain(self) -> None:
        """Look at all motors on one cable."""
        if len(self._wanted) < 2:
            return
        request = "connect all motors in a chain"
        while True:
            found = {motor.motor_id: motor for motor in self._tools.scan((self._baudrate,))}
            missing = [motor for motor in self._wanted if motor.motor_id not in found]
            shared = [
                motor for motor in self._wanted if motor not in missing and found[motor.motor_id].shared
            ]
            if not missing and not shared:
                for motor in self._wanted:
                    self._report_alarm(found[motor.motor_id], motor)
                self._dialogue.say(f"all {len(self._wanted)} motors answer at {self._baudrate} bit/s")
                return
            if shared:
                request = f"several motors answer to {_list(shared)}: connect each motor once"
            elif len(missing) < len(self._wanted) - 1:
                request = f"{_list(missing)} does not answer; check its cable"
            self._dialogue.wait_for(request)


def _list(motors: Sequence[WantedMotor]) -> str:
    return ", ".join(map(str, motors))
