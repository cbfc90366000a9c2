"""The calibration procedure of one arm as a state machine: readings and requests in, a view and a result out.

It does no I/O and has no clock: a session feeds it, front ends show its view.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence

from joshua.api.calibration import ArmCalibration

from joshua_calibration.result import RangeRefused, motor_calibration, require_middle, require_range
from joshua_calibration.sweep import Sweep
from joshua_calibration.target import TargetMotor
from joshua_calibration.track import Track
from joshua_calibration.view import JointState, JointView, Step, View

GAP_S = 0.25  # after a longer gap a joint may have moved either way round
STEADY_S = 0.4  # time to hold the arm still in the middle pose
STEADY = 1 / 256  # of a turn: tolerance for a joint that is held still
TOGETHER = 1 / 18  # of a turn: tolerance for the other joints during a sweep
BEYOND = 1 / 120  # of a turn: tolerance for a joint beyond its measured range

NOT_ACCEPTED = "not accepted yet"
HOMING_TEXT = (
    "Hold the arm so that every joint is in the middle of its range, then confirm. "
    "Torque is off: the arm drops where you let it go."
)
SWEEP_TEXT = "Move {name} from one end of its range to the other and back; keep the other joints still."
SWEPT_TEXT = "{name} is complete: confirm to go on."
REVIEW_TEXT = "Every joint is complete. Confirm to write the calibration, or repeat a joint."


class Procedure:
    """Calibrates one arm by hand: middle pose, range of each joint, review.

    A request that is refused leaves the state unchanged; ``view().message`` gives the reason.

    Args:
        motors: of the arm, in joint order.
        previous: earlier calibration; its joint names and directions are kept.
    """

    def __init__(self, motors: Sequence[TargetMotor], previous: ArmCalibration | None = None) -> None:
        if not motors:
            raise ValueError("an arm without motors cannot be calibrated")
        self.motors = tuple(motors)
        known = {motor.id: motor for motor in previous.motors} if previous else {}
        self.names = _names(motors, {i: known[i].joint_name for i in known})
        self._inverted = [motor.id in known and known[motor.id].inverted for motor in motors]
        self._tracks = [Track(motor.ticks_per_turn) for motor in motors]
        self._sweeps = [Sweep(motor) for motor in motors]
        self._done = [False] * len(motors)
        self._notes = [""] * len(motors)
        self._homes: list[tuple[int, int]] | None = None  # unwrapped and raw position of the middle pose
        self._baselines: list[int] = []
        self._strayed: int | None = None
        self._recent: deque[tuple[float, tuple[int, ...]]] = deque()
        self._time_s: float | None = None
        self._lost = ""
        self._active = 0
        self._message = ""
        self._is_problem = False
        self.step = Step.HOMING

    def observe(self, time_s: float, raw: Sequence[int]) -> None:
        """Add the encoder positions of all joints at a time of any monotonic clock.

        Raises:
            ValueError: the number of positions is wrong, or one is outside a turn.
        """
        self._require_readings(raw)
        gap_s = 0.0 if self._time_s is None else time_s - self._time_s
        continuous = self._time_s is not None and 0.0 <= gap_s <= GAP_S
        before = [track.position for track in self._tracks]
        for index, (track, value) in enumerate(zip(self._tracks, raw, strict=True)):
            if continuous:
                track.follow(value)
            else:
                track.resume(value, self._homes[index][0] if self._homes else None)
        if self._lost:
            self._say("The arm responds again.")
        self._time_s, self._lost = time_s, ""
        self._remember(time_s, continuous)
        if self.step is Step.SWEEP:
            self._sweep(continuous, before, gap_s)
        if self.step in (Step.SWEEP, Step.REVIEW):
            self._look_beyond()

    def lost(self, time_s: float, reason: str, *, gone: bool = False) -> None:
        """Report that the arm does not reply; after a short time, confirming is refused.

        Args:
            gone: the arm must be opened again before it can reply, so confirming is refused at once.
        """
        if gone or self._time_s is None or not 0.0 <= time_s - self._time_s <= GAP_S:
            self._lost = reason
            self._recent.clear()

    def confirm(self) -> None:
        """Confirm the present step: take the middle pose, continue with the next joint, or start writing."""
        self._say("")
        if self._lost:
            self._refuse(f"The arm does not answer: {self._lost}")
        elif self.step is Step.HOMING:
            self._take_home()
        elif self.step is Step.SWEEP:
            self._finish_joint()
        elif self.step is Step.REVIEW:
            self.step = Step.WRITE

    def repeat(self, index: int) -> None:
        """Discard the range of one joint and measure it again."""
        if self.step not in (Step.SWEEP, Step.REVIEW) or not 0 <= index < len(self.motors):
            self._refuse("This joint cannot be repeated at this step.")
            return
        self._say("")
        self._start(index)

    def back(self) -> None:
        """Go back to the middle pose; measured ranges are kept."""
        if self.step not in (Step.SWEEP, Step.REVIEW):
            self._refuse("There is no earlier step.")
            return
        self._say("")
        self.step = Step.HOMING

    def written(self) -> None:
        """Report that device and file hold the result."""
        self.step = Step.DONE
        self._say("")

    def not_written(self, reason: str) -> None:
        """Report that writing failed and the old calibration is still used; ranges are kept for a retry."""
        self.step = Step.REVIEW
        self._refuse(reason)

    def result(self, identity: str = "", calibrated_at: str = "") -> ArmCalibration:
        """Return the calibration. Raises RangeRefused if a joint has no range yet."""
        if self._homes is None:
            raise RangeRefused("the middle pose has not been recorded yet")
        motors = [
            motor_calibration(motor, name, inverted, sweep, home, home_raw)
            for motor, name, inverted, sweep, (home, home_raw) in zip(
                self.motors, self.names, self._inverted, self._sweeps, self._homes, strict=True
            )
        ]
        return ArmCalibration(motors=tuple(motors), device_identity=identity, calibrated_at=calibrated_at)

    def view(self) -> View:
        """Return the view for the user."""
        sweeping = self.step is Step.SWEEP
        problem = f"No answer from the arm: {self._lost}" if self._lost else ""
        return View(
            step=self.step,
            instruction=self._instruction(),
            message=problem or self._message,
            is_problem=bool(problem) or self._is_problem,
            joints=tuple(self._joint_view(index) for index in range(len(self.motors))),
            active=self._active if sweeping else None,
            commands=("confirm", "back", "repeat")
            if self.step in (Step.SWEEP, Step.REVIEW)
            else (("confirm",) if self.step is Step.HOMING else ()),
            ready=not self._lost and self._is_ready(),
        )

    # -- readings -------------------------------------------------------------------------------------------

    def _require_readings(self, raw: Sequence[int]) -> None:
        if len(raw) != len(self.motors):
            raise ValueError(f"{len(raw)} positions for {len(self.motors)} motors")
        for motor, value in zip(self.motors, raw, strict=True):
            if not 0 <= value < motor.ticks_per_turn:
                raise ValueError(f"motor {motor.id} reads {value}, outside 0 to {motor.ticks_per_turn - 1}")

    def _remember(self, time_s: float, continuous: bool) -> None:
        if not continuous:
            self._recent.clear()
        self._recent.append((time_s, tuple(track.position for track in self._tracks)))
        while len(self._recent) > 2 and self._recent[1][0] <= time_s - STEADY_S:
            self._recent.popleft()

    def _sweep(self, continuous: bool, before: Sequence[int], gap_s: float) -> None:
        index, sweep = self._active, self._sweeps[self._active]
        position = self._tracks[index].position
        had_moved = sweep.started
        sweep.observe(position, continuous=continuous)
        if not continuous and had_moved and abs(position - before[index]) > self._ticks(index, STEADY):
            self._refuse(
                f"Readings were lost for {gap_s:.1f} s while {self.names[index]} moved. "
                "Move it through its range once more."
            )
        if self._notes[index] == NOT_ACCEPTED and self._refusal(index) is None:
            self._notes[index] = ""  # the missing part has been measured again
            self._say("")
        for other, track in enumerate(self._tracks):
            way = abs(track.position - self._baselines[other])
            if other == index or way <= self._ticks(other, TOGETHER):
                continue
            if had_moved:
                self._restart_after(other, way)
                return
            self._strayed = other
            self._baselines[other] = track.position
            self._refuse(f"{self.names[other]} is moving. Move {self.names[index]} instead.")

    def _restart_after(self, other: int, way: int) -> None:
        index = self._active
        degrees = way * 360 / self.motors[other].ticks_per_turn
        self._start(index)
        self._refuse(
            f"{self.names[other]} moved by {degrees:.0f}° together with {self.names[index]}. Hold the other "
            f"joints still; {self.names[index]} starts again."
        )

    def _look_beyond(self) -> None:
        """Reject a range if its joint is later seen beyond it."""
        for index, sweep in enumerate(self._sweeps):
            if not self._done[index] or sweep.low is None or sweep.high is None or sweep.goes_round:
                continue
            margin, position = self._ticks(index, BEYOND), self._tracks[index].position
            if sweep.low - margin <= position <= sweep.high + margin:
                continue
            self._done[index] = False
            self._notes[index] = "moved beyond its range: repeat it"
            if self.step is Step.REVIEW:
                self._start(index)
            self._refuse(f"{self.names[index]} moved beyond its measured range. Repeat it.")

    # -- steps ----------------------------------------------------------------------------------------------

    def _take_home(self) -> None:
        if not self._recent or self._recent[-1][0] - self._recent[0][0] < STEADY_S:
            self._refuse("Hold the arm still for half a second, then confirm.")
            return
        for index, column in enumerate(zip(*(row for _, row in self._recent), strict=True)):
            if max(column) - min(column) > self._ticks(index, STEADY):
                self._refuse(f"{self.names[index]} is still moving. Hold the arm still, then confirm.")
                return
        self._homes = [(track.position, track.raw or 0) for track in self._tracks]
        wrong = self._off_middle()
        if wrong:
            self._refuse(wrong)
            return
        self.step = Step.SWEEP
        remaining = [index for index, done in enumerate(self._done) if not done]
        if not remaining:
            self.step = Step.REVIEW
        elif self._active not in remaining or self._sweeps[self._active].low is None:
            self._start(remaining[0])
        else:
            self._take_baselines()

    def _off_middle(self) -> str:
        """Find a measured range that does not contain the middle pose."""
        assert self._homes is not None
        for index, done in enumerate(self._done):
            if done:
                try:
                    require_middle(
                        self.motors[index], self.names[index], self._sweeps[index], self._homes[index][0]
                    )
                except RangeRefused as error:
                    return str(error)
        return ""

    def _finish_joint(self) -> None:
        index = self._active
        refusal = self._refusal(index)
        if refusal is not None:
            self._refuse(f"{refusal}{self._swapped(index)}.")
            self._notes[index] = NOT_ACCEPTED
            return
        self._done[index] = True
        self._notes[index] = "smaller than usual" if self._sweeps[index].is_short else ""
        remaining = [other for other, done in enumerate(self._done) if not done]
        if remaining:
            self._start(next((other for other in remaining if other > index), remaining[0]))
        else:
            self.step = Step.REVIEW

    def _swapped(self, index: int) -> str:
        """Return a hint if another joint moved than the requested one."""
        other = self._strayed
        if other is None or self._sweeps[index].moved:
            return ""
        ids = f"{self.motors[index].id} and {self.motors[other].id}"
        return f". {self.names[other]} moved instead: if you moved {self.names[index]}, ids {ids} are swapped"

    def _start(self, index: int) -> None:
        self.step = Step.SWEEP
        self._active = index
        self._done[index] = False
        self._notes[index] = ""
        self._sweeps[index] = Sweep(self.motors[index])
        self._sweeps[index].observe(self._tracks[index].position)
        self._take_baselines()

    def _take_baselines(self) -> None:
        self._strayed = None
        self._baselines = [track.position for track in self._tracks]

    # -- showing --------------------------------------------------------------------------------------------

    def _say(self, text: str) -> None:
        self._message, self._is_problem = text, False

    def _refuse(self, text: str) -> None:
        self._message, self._is_problem = text, True

    def _ticks(self, index: int, turns: float) -> float:
        return self.motors[index].ticks_per_turn * turns

    def _instruction(self) -> str:
        if self.step is Step.HOMING:
            return HOMING_TEXT
        if self.step is Step.SWEEP:
            text = SWEPT_TEXT if self._sweeps[self._active].complete else SWEEP_TEXT
            return text.format(name=self.names[self._active])
        return {Step.REVIEW: REVIEW_TEXT, Step.WRITE: "Writing …", Step.DONE: "Calibrated."}[self.step]

    def _is_ready(self) -> bool:
        if self.step is Step.SWEEP:
            return self._refusal(self._active) is None
        return self.step in (Step.HOMING, Step.REVIEW)

    def _refusal(self, index: int) -> RangeRefused | None:
        """Return why the range of a joint cannot be accepted yet."""
        assert self._homes is not None
        try:
            require_range(self.motors[index], self.names[index], self._sweeps[index], self._homes[index][0])
        except RangeRefused as error:
            return error
        return None

    def _joint_view(self, index: int) -> JointView:
        motor, sweep, track = self.motors[index], self._sweeps[index], self._tracks[index]
        scale = 360 / motor.ticks_per_turn
        half = motor.ticks_per_turn // 2
        known = self._homes is not None
        zero = self._homes[index][0] if self._homes else half
        # before the middle pose, the raw encoder position
        present = track.position if known else track.raw

        def degrees(position: int | None) -> float | None:
            return None if position is None else (position - zero) * scale

        return JointView(
            id=motor.id,
            name=self.names[index],
            state=self._state(index),
            present_deg=None if track.raw is None else degrees(present),
            low_deg=degrees(sweep.low) if known else None,
            high_deg=degrees(sweep.high) if known else None,
            coverage=sweep.coverage,
            low_found=sweep.low_found or sweep.goes_round,
            high_found=sweep.high_found or sweep.goes_round,
            note=self._notes[index],
        )

    def _state(self, index: int) -> JointState:
        if self._done[index]:
            return JointState.DONE
        if self.step is Step.SWEEP and index == self._active:
            return JointState.COMPLETE if self._sweeps[index].complete else JointState.ACTIVE
        return JointState.REFUSED if self._notes[index] else JointState.WAITING


def _names(motors: Sequence[TargetMotor], known: Mapping[int, str]) -> tuple[str, ...]:
    """Return the joint names of the earlier calibration if they fit, else those of the motors."""
    names = tuple(known.get(motor.id, motor.joint_name) for motor in motors)
    return names if len(set(names)) == len(names) else tuple(motor.joint_name for motor in motors)
