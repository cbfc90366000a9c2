"""Forms of ``joshua calibrate`` that open the arms: calibrate, ``--check``, ``--recover``."""

from __future__ import annotations

import sys
import threading
from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING

from joshua.api import DeviceError
from joshua.tools import (
    Checked,
    ExitCode,
    NotStartedError,
    Purpose,
    check_file,
    replace_devices,
    request_of,
)

from joshua_calibration.arms import (
    MODE,
    Refused,
    find_arms,
    open_arms,
    open_those_there,
    plan_of,
    recover_arms,
    taken,
)
from joshua_calibration.comparison import compare, comparison_text

if TYPE_CHECKING:
    import argparse

    from joshua.tools import EmulatedRig

    from joshua_calibration.session import Arm


def with_arms(arguments: argparse.Namespace) -> int:
    """Open the arms of the file and run the requested action."""
    if not arguments.check:
        arguments.overrides = [*arguments.overrides, f"general.mode={MODE}"]
    purpose = Purpose.SHOW if arguments.check else Purpose.LAUNCH
    try:
        with ExitStack() as stack:
            checked = check_file(request_of(arguments, purpose))
            if checked.result.errors:
                raise NotStartedError.of(checked.result, arguments.format)
            checked, rig = replace_devices(checked, arguments, stack)
            if not (arguments.check or arguments.recover):
                from joshua_calibration.run import run_calibration

                return run_calibration(checked, arguments, rig)
            return _look(checked, arguments, rig, stack)
    except NotStartedError as error:
        return error.show()
    except Refused as error:
        sys.stderr.write(f"joshua calibrate: {error}\n")
        return error.code


def _look(checked: Checked, arguments: argparse.Namespace, rig: EmulatedRig | None, stack: ExitStack) -> int:
    plan, previous = plan_of(checked, arguments)
    arms = find_arms(plan, previous, rig=rig, simulated=arguments.sim, only=arguments.nodes or ())
    stop = threading.Event()
    doing = "calibration is recovered" if arguments.recover else "calibration is compared"
    taken(plan, arms, stop.set, stack, doing)
    if arguments.recover:
        return _recover(arms, stack)
    for arm in arms:  # also for an arm that is not connected
        if arm.journal.stands:
            sys.stdout.write(
                f"{arm.node_name}: a calibration was interrupted while it was written. Run "
                f"`{arm.journal.recovery}`.\n"
            )
    open_arms(arms, stack, release=False)
    code = ExitCode.OK
    for arm in arms:
        if stop.is_set():
            raise Refused("stopped before every arm was compared", ExitCode.FAILED)
        # a calibration run does not load the file that it replaces; an emulator reports its own calibration
        wanted = arm.previous if plan.mode == MODE else previous.get(arm.node_name) or arm.previous
        try:
            found = compare(
                arm.node_name,
                wanted,
                arm.target,
                interrupted=arm.journal.stands,
                source=plan.source,
                overrides=arguments.overrides,
            )
        except DeviceError as error:
            raise Refused(f"{arm.node_name}: {error}", ExitCode.HARDWARE) from error
        sys.stdout.write(comparison_text(found))
        if found.problems:
            code = ExitCode.FAILED
    return code


def _recover(arms: Sequence[Arm], stack: ExitStack) -> int:
    """Recover the interrupted arms that are connected; the others may be absent. Raises Refused."""
    interrupted = [arm for arm in arms if arm.journal.stands]
    for arm in arms:
        arm.file.sweep()
        if not arm.journal.stands:
            arm.journal.remove()
    if not interrupted:
        sys.stdout.write("no calibration of these arms was interrupted\n")
        return ExitCode.OK
    there, problems = open_those_there(interrupted, stack)
    recover_arms(there)
    if problems:
        commands = "\n".join(
            f"Connect {arm.node_name} and run `{arm.journal.recovery}`."
            for arm in interrupted
            if arm not in there
        )
        raise Refused("\n".join([*problems, commands]), ExitCode.HARDWARE)
    return ExitCode.OK
