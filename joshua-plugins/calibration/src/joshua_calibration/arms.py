"""The arms to calibrate, from a checked file."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING

from joshua.api import DeviceError
from joshua.api.calibration import ArmCalibration
from joshua.tools import (
    Checked,
    ExitCode,
    FileRefused,
    NodeKind,
    NotStartedError,
    Plan,
    TargetError,
    calibration_place,
    exit_code_of,
    finish,
    foreground_job,
    journal_path,
    open_driver,
    show_findings,
)

from joshua_calibration.arm_file import ArmFile
from joshua_calibration.front_end import ArmState
from joshua_calibration.journal import Journal
from joshua_calibration.session import Arm
from joshua_calibration.transaction import NotWritten, Recovery, recover

if TYPE_CHECKING:
    import argparse

    from joshua.tools import EmulatedRig


MODE = "MODE_CALIBRATION"


class Refused(Exception):
    """The command cannot continue. The message gives reason and remedy; "" if already shown.

    Attributes:
        code: exit code.
    """

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


def plan_of(checked: Checked, arguments: argparse.Namespace) -> tuple[Plan, dict[str, ArmCalibration]]:
    """Return the plan without the calibrations to replace, and those calibrations by node name.

    Raises Refused.
    """
    config = checked.loaded.config
    included = {}
    for block in config.calibration.arms:
        try:
            included[block.node_name] = ArmCalibration.from_block(block)
        except ValueError:  # an invalid calibration has no names and directions worth keeping
            continue
    config.ClearField("calibration")
    result = finish(checked)
    if result.plan is None:
        show_findings(result, arguments.format)
        raise Refused("nothing was started", exit_code_of(result))
    return result.plan, included


def find_arms(
    plan: Plan,
    previous: dict[str, ArmCalibration],
    *,
    rig: EmulatedRig | None,
    simulated: bool = False,
    only: Sequence[str] = (),
) -> list[Arm]:
    """Return the arms of a plan that can be calibrated; print which nodes are left out.

    Args:
        previous: calibrations by node name; rig: emulators of the devices.
        simulated: the simulation replaces the devices; only: names of nodes, () for all.

    Raises Refused.
    """
    path = calibration_place(rig is not None, simulated)(plan.source, plan.robot_id)
    if not path:
        raise Refused(
            'general.id names the calibration file, and this file has none: add id: "my-robot" to general',
            ExitCode.INVALID,
        )
    file = ArmFile(path)
    try:
        file.require_writable()
    except FileRefused as error:
        raise Refused(str(error), ExitCode.INVALID) from error
    guides = {emulator.device.node_name: emulator.guide for emulator in rig.emulators} if rig else {}
    arms, left_out = [], []
    for spec in plan.nodes:
        if spec.kind is NodeKind.SERVICE:
            continue
        target = None
        if spec.kind is NodeKind.ACTUATOR:
            try:
                target = open_driver(spec).calibration_target()
            except TargetError as error:
                raise Refused(str(error), ExitCode.NOT_INSTALLED) from error
            except NotImplementedError:
                target = None
        if target is None:
            left_out.append(spec.name)
            continue
        try:
            before = file.arm(spec.name) or previous.get(spec.name)
        except FileRefused as error:
            raise Refused(str(error), ExitCode.INVALID) from error
        how = " --emulate" if rig is not None else " --sim" if simulated else ""
        command = f"joshua calibrate --recover --config {shlex.quote(plan.source)} --node {spec.name}{how}"
        journal = Journal(journal_path(path, spec.name), command)
        guide = guides.get(spec.name) or target.hand
        arms.append(Arm(spec.name, target, file, journal, before, guide))
    return _chosen(arms, left_out, only)


def _chosen(arms: list[Arm], left_out: list[str], only: Sequence[str]) -> list[Arm]:
    names = [arm.node_name for arm in arms]
    unknown = [name for name in only if name not in names]
    if unknown or not arms:
        what = (
            f"no actuator that can be calibrated is called {unknown[0]}"
            if unknown
            else "nothing to calibrate"
        )
        raise Refused(
            f"{what}; allowed: {', '.join(names) or 'none'}"
            + (f" ({', '.join(left_out)}: no calibration needed or offered)" if left_out else ""),
            ExitCode.INVALID,
        )
    if left_out:
        sys.stdout.write(f"not started, because they need no calibration: {', '.join(left_out)}\n")
    return [arm for arm in arms if not only or arm.node_name in only]


def taken(
    plan: Plan, arms: Sequence[Arm], stop: Callable[[], None], stack: ExitStack, doing: str = ""
) -> None:
    """Claim the nodes of the arms until ``stack`` closes, so ``joshua status`` and ``stop`` see them.

    Args:
        stop: called by ``joshua stop``, in another thread.
        doing: activity of all arms; "" for a calibration, whose step differs by arm.

    Raises Refused.
    """
    states = {arm.node_name: arm for arm in arms}

    def report(name: str) -> tuple[str, str]:
        state = states[name].state
        is_over = state in (ArmState.DONE, ArmState.STOPPED)
        return "stopped" if is_over else "ready", doing or f"calibration: {state.value}"

    try:
        stack.enter_context(foreground_job(plan, MODE, states, report, stop))
    except NotStartedError as error:
        raise Refused(str(error), error.code) from error


def open_those_there(arms: Sequence[Arm], stack: ExitStack) -> tuple[list[Arm], list[str]]:
    """Open the connected arms; return them and the problems of the others."""
    there, problems = [], []
    for arm in arms:
        stack.callback(arm.target.disconnect)
        try:
            arm.target.connect()
        except DeviceError as error:
            problems.append(f"{arm.node_name}: {error}")
        else:
            there.append(arm)
    return there, problems


def open_arms(arms: Sequence[Arm], stack: ExitStack, *, release: bool = True) -> None:
    """Open every arm and disable its torque. Raises Refused, which lists the problems of all arms."""
    there, problems = open_those_there(arms, stack)
    for arm in there if release else ():
        try:
            arm.target.release()
        except DeviceError as error:
            problems.append(f"{arm.node_name}: {error}")
    if problems:
        raise Refused("\n".join([*problems, "nothing was calibrated"]), ExitCode.HARDWARE)


def recover_arms(arms: Sequence[Arm]) -> list[Recovery]:
    """Recover from interrupted earlier runs and print the outcome. Raises Refused."""
    found = []
    for arm in arms:
        try:
            outcome = recover(arm.target, arm.file, arm.journal)
        except NotWritten as error:
            raise Refused(f"{arm.node_name}: {error}", ExitCode.HARDWARE) from error
        found.append(outcome)
        if outcome is not Recovery.NOTHING:
            sys.stdout.write(f"{arm.node_name}: an earlier calibration was interrupted; {outcome.value}\n")
    return found
