"""``joshua estop``: take the torque off every actuator, and keep it off until the latch is released."""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import add_config_options, positive_seconds

if TYPE_CHECKING:
    from joshua.cli.estop.latches import UserLatches
    from joshua.cli.estop.running import EstopTarget
    from joshua.guardian.latch import EstopReport
    from joshua.plan import Plan

SUMMARY = "take the torque off every actuator, and keep it off"

TIMEOUT_S = 5.0

#: A run that is just being started shows that within this time …
STARTING_S = 2.0
#: … and is there for this command within this one, before it gives any torque.
STARTED_S = 30.0
POLL_S = 0.05


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of the command."""
    parser.add_argument(
        "system",
        nargs="?",
        default="",
        metavar="SYSTEM",
        help="file or process id as `joshua status` shows it; every system of this machine if absent",
    )
    parser.add_argument("--release", action="store_true", help="release the latch; nothing moves by that")
    parser.add_argument(
        "--timeout",
        type=positive_seconds,
        default=TIMEOUT_S,
        metavar="SECONDS",
        help="how long to wait for what the devices say",
    )
    add_config_options(parser)


def run(args: argparse.Namespace) -> int:
    """Latches and verifies, or releases.

    Exit code 0: everything asked for is confirmed; 1: there was nothing to stop; 2: unclear which system, or
    the file is invalid; 4: a device has not confirmed that its torque is off.
    """
    from joshua.cli.estop.latches import UserLatches
    from joshua.ipc.run_bases import RunDirectoryError, base_directories

    word = getattr(args, "config", None) or args.system
    try:
        bases = base_directories(os.environ, make=not args.release)
        if args.release:
            return release(bases, UserLatches(bases), word)
        return stop(bases, UserLatches(bases), word, args)
    except KeyboardInterrupt:
        sys.stderr.write("joshua estop: interrupted: the latch stands; what it has reached is not known\n")
        raise
    except (OSError, RunDirectoryError) as error:
        sys.stderr.write(f"joshua estop: {error}; cut the supply of the robot by hand\n")
        return ExitCode.HARDWARE


def stop(bases: list[Path], latches: UserLatches, word: str, args: argparse.Namespace) -> int:
    """Latches the e-stop of the chosen systems, all at once, and waits for what each device says."""
    systems = _systems(bases, word)
    if not systems and getattr(args, "config", None):
        return stop_file(bases, latches, args)
    systems = systems or _starting(bases, word)
    if not systems:
        known = _systems(bases, "")
        problem = f"no system {word!r} runs" if known else "nothing runs"
        sys.stderr.write(
            f"joshua estop: {problem}, so nothing was stopped. An arm that holds its position after a run is "
            "released by joshua estop --config FILE\n"
        )
        sys.stderr.writelines(f"  {item.info.process_id}  {item.info.source}\n" for item in known)
        return ExitCode.INVALID if known else ExitCode.FAILED
    code = stop_systems(systems, latches, args.timeout)
    if not word and (late := _started_beside(bases, systems)):
        code = stop_systems(late, latches, args.timeout) or code
    return code


def stop_systems(systems: list[EstopTarget], latches: UserLatches, timeout_s: float) -> int:
    """Latches the e-stops first, then waits for each system."""
    latched = []
    for system in systems:
        info = system.info
        latch = latches.set(system.base, info.robot, info.source, info.domain_id, info.actuators)
        latched.append((system, latch))
    good = True
    for system, latch in latched:
        silence = system.notify()
        reports = system.wait(latch, latches.at(system.base), timeout_s)
        good &= _show(f"{system.info.source} (process {system.info.process_id})", reports)
        if silence:
            sys.stderr.write(
                f"the supervisor, process {system.info.process_id}, does not answer ({silence}): drivers and "
                "guardians were reached without it\n"
            )
    _say_what_next()
    return ExitCode.OK if good else ExitCode.HARDWARE


def stop_file(bases: list[Path], latches: UserLatches, args: argparse.Namespace) -> int:
    """Latches the e-stop of a file that does not run, and releases its actuators from here.

    A run of the same robot under another file is stopped as such.
    """
    from joshua.cli.estop import offline
    from joshua.cli.report import exit_code_of, request_of, show_findings
    from joshua.guardian.latch import Subject
    from joshua.planner.pipeline import examine
    from joshua.planner.request import Purpose

    for name, value in (("overrides", []), ("blocked_plugins", []), ("host", None), ("format", "text")):
        setattr(args, name, getattr(args, name, value))
    result = examine(request_of(args, Purpose.SHOW))
    plan: Plan | None = result.plan
    if plan is None:
        show_findings(result, args.format)
        sys.stderr.write("joshua estop: the file names no devices to reach: nothing was stopped\n")
        return exit_code_of(result)
    specs = offline.actuators(plan)
    subjects = [Subject(plan.robot_id, plan.transport.domain_id, spec.full_name) for spec in specs]
    same = [system for system in _systems(bases, "") if any(map(system.concerns, subjects))]
    if same:
        return stop_systems(same, latches, args.timeout)
    source = os.path.abspath(plan.source)  # noqa: PTH100 (links stay as they are)
    nodes = [spec.full_name for spec in specs]
    latch = latches.set(bases[0], plan.robot_id, source, plan.transport.domain_id, nodes)
    good = _show(f"{source} (does not run)", offline.release(specs, latch.identifier))
    _say_what_next()
    return ExitCode.OK if good else ExitCode.HARDWARE


def release(bases: list[Path], latches: UserLatches, word: str) -> int:
    """Releases one latch; where several stand, the user says which."""
    standing = latches.all()
    if not standing:
        sys.stdout.write("no e-stop is latched\n")
        return ExitCode.OK
    path = os.path.abspath(word)  # noqa: PTH100 (links stay as they are)
    chosen = [item for item in standing if not word or word == item.robot or path == item.source]
    if len({(item.robot, item.source, item.domain_id) for item in chosen}) != 1:
        problem = f"no e-stop of {word!r} is latched" if word and not chosen else "name one of these"
        sys.stderr.write(f"joshua estop --release: {problem}:\n")
        listing = dict.fromkeys(f"  {item.source or item.robot}  since {item.since}\n" for item in standing)
        sys.stderr.writelines(listing)
        return ExitCode.INVALID
    for latch in chosen:  # several: at each base, and where two have latched one robot at the same moment
        latches.clear(latch)
    for system in _systems(bases, ""):
        if system.info.robot == chosen[0].robot:
            system.notify(released=True)
    sys.stdout.write(
        f"released: {chosen[0].source or chosen[0].robot}\n"
        "nothing has torque by that: joshua resume NODE gives it to an actuator of a run\n"
    )
    return ExitCode.OK


def _systems(bases: list[Path], word: str) -> list[EstopTarget]:
    """Every system of this user, those whose supervisor was killed included, or those that a word names."""
    from joshua.cli.estop.running import EstopTarget
    from joshua.ipc.client import all_systems

    path = os.path.abspath(word)  # noqa: PTH100 (links stay as they are)
    return [
        EstopTarget(folder, info)
        for base in bases
        for folder, info in all_systems(base)
        if not word or word in (info.source, str(info.process_id)) or path == info.source
    ]


def _starting(bases: list[Path], word: str) -> list[EstopTarget]:
    """Waits for systems that are just being started, where none runs."""
    from joshua.supervisor.starting import started_processes

    waited_s = 0.0
    while not _systems(bases, ""):
        if waited_s >= (STARTED_S if started_processes(bases) else STARTING_S):
            break
        time.sleep(POLL_S)
        waited_s += POLL_S
    return _systems(bases, word)


def _started_beside(bases: list[Path], stopped: list[EstopTarget]) -> list[EstopTarget]:
    """Waits for systems that were just being started while others were stopped."""
    from joshua.supervisor.starting import started_processes

    waited_s = 0.0
    while waited_s < STARTED_S and started_processes(bases) - _process_ids(_systems(bases, "")):
        time.sleep(POLL_S)
        waited_s += POLL_S
    return [item for item in _systems(bases, "") if item.info.process_id not in _process_ids(stopped)]


def _process_ids(systems: list[EstopTarget]) -> set[int]:
    return {item.info.process_id for item in systems}


def _show(title: str, reports: list[EstopReport]) -> bool:
    from joshua.cli.estop.running import lines

    sys.stdout.write(f"e-stop latched: {title}\n")
    if not reports:
        sys.stdout.write("  none of its nodes gives torque\n")
    else:
        sys.stdout.write("\n".join(lines(reports)) + "\n")
    return all(report.complete for report in reports)


def _say_what_next() -> None:
    sys.stdout.write("nothing gets torque before: joshua estop --release\n")
