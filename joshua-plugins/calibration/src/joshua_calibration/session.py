"""A calibration from the first reading to the last write, arm by arm, with any front ends."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone

from joshua.api import DeviceError, DeviceSilent
from joshua.api.calibration import ArmCalibration

from joshua_calibration import transaction
from joshua_calibration.arm_file import ArmFile
from joshua_calibration.front_end import ArmState, Ask, Board, FrontEnd, Request
from joshua_calibration.journal import Journal
from joshua_calibration.procedure import Procedure
from joshua_calibration.target import CalibrationTarget, Hand
from joshua_calibration.view import Step, View

PERIOD_S = 0.02
SHOWN_EVERY_S = 0.05
RECONNECT_S = 0.5
MIDDLE_S = 1.5  # duration of the emulated motion to the middles
SWEEP_S = 5.0  # and through a range
SCRIPT_SPEED = 3.0  # speed-up without a user
SCRIPT_PAUSE_S = 0.5  # delay between a ready step and its automatic confirmation
SCRIPT_PATIENCE_S = 3.0  # timeout of the script for a step to become ready
SCRIPT_ATTEMPTS = 3  # how often it then repeats the motion


@dataclass
class Arm:
    """One arm of a run.

    Attributes:
        previous: earlier calibration; its joint names and directions are kept.
        guide: moves emulated or simulated joints; None for an arm that the user moves.
    """

    node_name: str
    target: CalibrationTarget
    file: ArmFile
    journal: Journal
    previous: ArmCalibration | None = None
    guide: Hand | None = None
    state: ArmState = ArmState.WAITING


class Stopped(Exception):
    """The user stopped the calibration."""


class Unfinished(Exception):
    """An automatic calibration did not finish. The message says where it stopped."""


class Session:
    """Runs the procedure of each arm; every arm is open, with torque off.

    Args:
        title: name of the robot.
        stopped: whether the run is to end.
        scripted: confirm each step automatically as soon as it is ready.
    """

    def __init__(
        self,
        title: str,
        arms: Sequence[Arm],
        front_ends: Sequence[FrontEnd],
        stopped: Callable[[], bool],
        *,
        scripted: bool = False,
    ) -> None:
        self._title = title
        self._arms = arms
        self._front_ends = front_ends
        self._stopped = stopped
        self._scripted = scripted
        self._procedure = Procedure(arms[0].target.motors)
        self._index = 0
        self._shown_s = 0.0
        self._guided: tuple[Step, int | None] | None = None
        self._guided_until_s = 0.0
        self._script_s = 0.0
        self._turned_s: float | None = None
        self._attempts = 0
        self._reconnect_s = 0.0

    def run(self) -> None:
        """Calibrate all arms.

        Raises:
            Stopped: the user stopped it; finished arms stay calibrated.
            Unfinished: an automatic step does not become ready, or an emulator moves no
                joints.
            NotWritten: writing failed, and the arm may need ``recover`` or there is no user to retry.
        """
        for index, arm in enumerate(self._arms):
            self._index = index
            arm.state = ArmState.ACTIVE
            self._procedure = Procedure(arm.target.motors, arm.previous)
            self._guided = None
            try:
                self._calibrate(arm)
            except BaseException:
                arm.state = ArmState.STOPPED
                raise
            arm.state = ArmState.DONE
            self._say(f"{arm.node_name} is calibrated: {arm.file.path}")

    def board(self, ended: str = "") -> Board:
        """Return the board to show now."""
        arms = tuple((arm.node_name, arm.state) for arm in self._arms)
        return Board(self._title, arms, self._index, self._procedure.view(), ended)

    def _calibrate(self, arm: Arm) -> None:
        while self._procedure.step is not Step.DONE:
            started_s = time.monotonic()
            if self._stopped():
                raise Stopped
            self._read(arm, started_s)
            for front_end in self._front_ends:
                for request in front_end.requests():
                    self._grant(request)
            self._move_by_script(arm, self._script_time_s(started_s))
            if self._procedure.step is Step.WRITE:
                self._show(always=True)
                self._write(arm)
            self._show()
            time.sleep(max(0.0, PERIOD_S - (time.monotonic() - started_s)))
        self._show(always=True)

    def _read(self, arm: Arm, now_s: float) -> None:
        try:
            if not arm.target.connected:
                if now_s < self._reconnect_s:
                    return
                arm.target.connect()
                arm.target.release()
            positions = arm.target.raw_positions()
            self._procedure.observe(time.monotonic(), positions)
        except DeviceError as error:
            # a single servo may reply again; a port that is gone will not
            gone = not isinstance(error, DeviceSilent)
            self._procedure.lost(time.monotonic(), str(error).splitlines()[0], gone=gone)
            if gone:
                self._show(always=True)  # even if it is back at once
                arm.target.disconnect()
                self._reconnect_s = time.monotonic() + RECONNECT_S

    def _grant(self, request: Request) -> None:
        if request.ask is Ask.QUIT:
            raise Stopped
        if request.ask is Ask.CONFIRM:
            self._procedure.confirm()
        elif request.ask is Ask.BACK:
            self._procedure.back()
        else:
            self._procedure.repeat(request.joint)
            self._guided = None

    def _script_time_s(self, now_s: float) -> float:
        """Return the time of the script, which pauses with the readings on a slow machine."""
        if self._turned_s is not None:
            self._script_s += min(now_s - self._turned_s, PERIOD_S)
        self._turned_s = now_s
        return self._script_s

    def _move_by_script(self, arm: Arm, now_s: float) -> None:
        """Move an emulated or simulated arm as the procedure requests, and confirm if scripted."""
        view = self._procedure.view()
        task = (view.step, view.active)
        if task != self._guided:
            seconds = self._guide(arm, view)
            self._guided_until_s = now_s + seconds + SCRIPT_PAUSE_S
            if self._guided is not None:
                self._attempts = 0
        self._guided = task
        if not self._scripted or now_s < self._guided_until_s:
            return
        if view.ready:
            self._guided_until_s = now_s + SCRIPT_PAUSE_S
            self._procedure.confirm()
            self._attempts += self._procedure.step is view.step is Step.HOMING
        elif now_s > self._guided_until_s + SCRIPT_PATIENCE_S:
            self._guided = None  # repeat the motion, as a user would
            self._attempts += 1
        if self._attempts > SCRIPT_ATTEMPTS:
            raise Unfinished(f"{arm.node_name}: {view.message or view.instruction}")

    def _guide(self, arm: Arm, view: View) -> float:
        """Move emulated or simulated joints. Return the duration."""
        if arm.guide is None or view.step not in (Step.HOMING, Step.SWEEP):
            return 0.0
        seconds = MIDDLE_S if view.active is None else SWEEP_S
        if self._scripted:
            seconds /= SCRIPT_SPEED
        if not arm.guide(view.active, seconds):
            raise Unfinished(
                f"{arm.node_name}: its emulator or simulation cannot move the joints, and a person cannot "
                "either"
            )
        return seconds

    def _write(self, arm: Arm) -> None:
        stamp = datetime.now(timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
        calibration = self._procedure.result(arm.target.identity, stamp)
        try:
            transaction.write(arm.target, arm.node_name, calibration, arm.file, arm.journal, self._stopped)
        except transaction.NotWritten as error:
            if not error.restored or self._scripted:
                raise
            self._procedure.not_written(str(error))
            self._say(str(error))
        else:
            self._procedure.written()

    def _show(self, *, always: bool = False) -> None:
        now_s = time.monotonic()
        if always or now_s - self._shown_s >= SHOWN_EVERY_S:
            self._shown_s = now_s
            board = self.board()
            for front_end in self._front_ends:
                front_end.show(board)

    def _say(self, text: str) -> None:
        for front_end in self._front_ends:
            front_end.say(text)
