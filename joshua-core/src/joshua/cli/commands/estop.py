"""``joshua estop``: disable the torque of every actuator until the e-stop is released."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import add_config_options, add_timeout

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping, Sequence

    from joshua.cli.estop import EstopTarget
    from joshua.guardian.energised import EnergisedRecord
    from joshua.guardian.latch import EstopReport, Latch, LatchFolder
    from joshua.ipc.process_mark import ProcessMark

    Latches = Mapping[Path, LatchFolder]

#: Within this time, a starting run becomes visible …
STARTING_S = 2.0
#: … and within this one its actuators can be latched, before they have torque.
STARTED_S = 30.0
POLL_S = 0.05


class Outcome(NamedTuple):
    """What an e-stop did to the actuators of one system or file.

    Attributes:
        title: of the system; reports: on its actuators.
        roads: of the e-stop, and what happened on each; lasting: whether the torque stays off.
    """

    title: str
    reports: list[EstopReport]
    roads: list[tuple[str, str]]
    lasting: bool


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_config_options(
        parser, file="configuration or process id of a system; omitted stops every system of this machine"
    )
    parser.add_argument("--release", action="store_true", help="release the e-stop; torque stays off")
    add_timeout(parser, "how long to wait for the devices (default 5)", 5.0)


def run(args: argparse.Namespace) -> int:
    """Latch and verify, or release.

    Exit code 0: every device has confirmed; 1: there was nothing to stop; 2: unclear which system, or the
    file is invalid; 4: a device has not confirmed that its torque is off.
    """
    from joshua.cli.estop import user_latches
    from joshua.ipc.run_bases import RunDirectoryError, base_directories

    try:
        latches = user_latches(base_directories(os.environ, make=not args.release))
        return release(latches, args.config or "") if args.release else stop(latches, args)
    except KeyboardInterrupt:
        sys.stderr.write(
            "joshua estop: interrupted: the e-stop is latched, but some devices may not have confirmed\n"
        )
        raise
    except (OSError, RunDirectoryError) as error:
        sys.stderr.write(f"joshua estop: {error}. Cut the power of the robot by hand\n")
        return ExitCode.HARDWARE


def stop(latches: Latches, args: argparse.Namespace) -> int:
    """Latch the e-stop of all chosen systems first, then wait for each device."""
    word = args.config or ""
    systems = _systems(latches, word)
    if not systems and Path(word).is_file():
        return stop_file(latches, args)
    left = [] if systems else reach_left(latches, word)
    lost = [] if word or systems else _lost(latches)
    if lost:
        return _show(left + stop_lost(latches, lost, args.timeout))
    if not systems and not (word and left):
        systems = _starting(latches, word)
    if not systems and not left:
        known = _systems(latches, "")
        problem = f"{word} is neither a running system nor a file" if word else "no system is running"
        sys.stderr.write(
            f"joshua estop: {problem}, so nothing was stopped\n"
            "To release an arm that holds its position after a run: joshua estop FILE\n"
        )
        sys.stderr.writelines(f"  {item.info.process_id}  {item.info.source}\n" for item in known)
        return ExitCode.INVALID if known else ExitCode.FAILED
    outcomes = left + reach_systems(systems, latches, args.timeout)
    if not word and not left:
        outcomes += reach_left(latches, "")
    code = _show(outcomes)  # after every actuator was reached, because output may fail
    if not word and systems and (late := _started_beside(latches, systems)):
        code = _show(reach_systems(late, latches, args.timeout)) or code
    return code


def reach_systems(
    systems: list[EstopTarget],
    latches: Latches,
    timeout_s: float,
    replaced: Sequence[tuple[LatchFolder, Latch]] = (),
) -> list[Outcome]:
    """Latch every e-stop first, then wait for each system.

    Args:
        replaced: latches for every actuator, which those of the systems replace.
    """
    for system in systems:
        system.begin(latches, timeout_s)
    for folder, latch in replaced:  # before the wait: actuators report on the latch that counts for all
        with contextlib.suppress(OSError):  # `joshua estop --release` names it
            folder.clear(latch)
    reached = [(system, system.reports()) for system in systems]
    from joshua.cli.energised import forget_released

    outcomes = []
    for system, reports in reached:
        forget_released(latches, system.info.source, reports)
        title = f"{system.info.source} (process {system.info.process_id})"
        outcomes.append(Outcome(title, reports, system.roads(), system.stays_off))
    return outcomes


def reach_left(latches: Latches, word: str) -> list[Outcome]:
    """Latch and release the actuators that runs left with torque, all or those of a file.

    They are reached as their drivers reached them, whatever their files say meanwhile.
    """
    from joshua.cli.energised import recorded

    path = os.path.abspath(word)  # noqa: PTH100 (links stay as they are)
    files: dict[tuple[str, str, int], list[EnergisedRecord]] = {}
    for _, record in recorded(latches):
        if not word or record.source == path:
            files.setdefault((record.robot, record.source, record.domain_id), []).append(record)
    return [_reach_recorded(latches, records) for records in files.values()]


def stop_lost(latches: Latches, marks: Sequence[ProcessMark], timeout_s: float) -> list[Outcome]:
    """Stop runs whose folder has vanished, of which only their guardians are known.

    A latch for every actuator of this user acts at once. Then a supervisor may make the folder again, so that
    its run is stopped as any other. Without one, nobody reports.
    """
    from joshua.cli.lost_guardians import await_end
    from joshua.guardian.latch import EstopReport

    roads, standing = [], []
    for folder in latches.values():
        try:
            latch = folder.set_for_all()
        except OSError as error:
            roads.append(("latch", f"not set in {folder.path}: {error.strerror or error}"))
            continue
        standing.append((folder, latch))
        roads.append(("latch", f"set in {latch.source}; it counts for every actuator of this user"))
    systems = _starting(latches, "")
    if systems:
        return reach_systems(systems, latches, timeout_s, replaced=standing)
    await_end(marks, timeout_s)
    reports = []
    for mark in marks:
        ended = "has ended, as it does when the torque is off" if mark.state == "gone" else f"is {mark.state}"
        detail = f"its guardian {ended}, and with the folder of its run, all reports have vanished"
        reports.append(EstopReport("", f"of process {mark.process_id}", "guardian", False, False, {}, detail))
    return [Outcome("runs whose folder has vanished", reports, roads, bool(standing))]


def _reach_recorded(latches: Latches, records: list[EnergisedRecord]) -> Outcome:
    """Latch and release the recorded actuators of one file."""
    from joshua.cli.energised import release_recorded
    from joshua.cli.estop import set_latch

    first = records[0]
    nodes = [record.node for record in records]
    latched = set_latch(latches, next(iter(latches)), first.robot, first.source, first.domain_id, nodes)
    reports = release_recorded(latches, latched.latch, records)
    roads = [("latch", latched.detail), ("device", "opened here")]
    return Outcome(f"{first.source} (not running)", reports, roads, latched.stored)


def stop_file(latches: Latches, args: argparse.Namespace) -> int:
    """Latch the e-stop of a file that does not run, and release its actuators from here.

    Actuators that its last run left with torque are reached as their drivers reached them, even if the file
    is invalid meanwhile. A run of the same robot under another file is stopped instead.
    """
    from joshua.cli.energised import forget_released, recorded
    from joshua.cli.estop import release_offline, set_latch
    from joshua.cli.report import exit_code_of, request_of, show_findings
    from joshua.guardian.latch import Subject
    from joshua.plan import NodeKind
    from joshua.planner.pipeline import examine
    from joshua.planner.request import Purpose

    source = os.path.abspath(args.config)  # noqa: PTH100 (links stay as they are)
    records = [record for _, record in recorded(latches) if record.source == source and record.implementation]
    left = _reach_recorded(latches, records) if records else None
    result = examine(request_of(args, Purpose.SHOW))
    plan = result.plan
    if plan is None and left is not None:
        return _show([left])
    if plan is None:
        show_findings(result, args.format)
        sys.stderr.write("joshua estop: the file is invalid, so nothing was stopped\n")
        return exit_code_of(result)
    domain_id = plan.transport.domain_id
    specs = [spec for spec in plan.nodes if spec.kind is NodeKind.ACTUATOR]
    subjects = [Subject(plan.robot_id, domain_id, spec.full_name) for spec in specs]
    same = [system for system in _systems(latches, "") if any(map(system.concerns, subjects))]
    if same:
        return _show(reach_systems(same, latches, args.timeout))
    nodes = [spec.full_name for spec in specs]
    latched = set_latch(latches, next(iter(latches)), plan.robot_id, source, domain_id, nodes)
    reports = {} if left is None else {report.node: report for report in left.reports}
    for spec in specs:
        report = reports.get(spec.full_name)
        if report is None or not report.complete or args.overrides:
            reports[spec.full_name] = release_offline(spec, latched.latch)
    forget_released(latches, source, reports.values())
    roads = [("latch", latched.detail), ("device", "opened here")]
    return _show([Outcome(f"{source} (not running)", list(reports.values()), roads, latched.stored)])


def release(latches: Latches, word: str) -> int:
    """Release one e-stop; the user says which if there are several."""
    standing = [latch for folder in latches.values() for latch in folder.all()]
    if not standing:
        return release_held(_systems(latches, word))
    path = os.path.abspath(word)  # noqa: PTH100 (links stay as they are)
    chosen = [item for item in standing if not word or word == item.robot or path == item.source]
    if len({(item.robot, item.source, item.domain_id) for item in chosen}) != 1:
        problem = f"no e-stop of {word!r} is latched" if word and not chosen else "name one of these"
        sys.stderr.write(f"joshua estop --release: {problem}:\n")
        listing = dict.fromkeys(f"  {item.source or item.robot}  since {item.since}\n" for item in standing)
        sys.stderr.writelines(listing)
        return ExitCode.INVALID
    problems = []
    for latch in chosen:  # one per base, and more if two commands latched a robot at the same moment
        for folder in latches.values():
            try:
                folder.clear(latch)
            except OSError as error:
                problems.append(f"{folder.path}: {error.strerror or error}")
    if problems:
        sys.stderr.write(
            f"joshua estop --release: the e-stop is still latched: {'; '.join(problems)}. Make the folder "
            "writable, then run: joshua estop --release\n"
        )
        return ExitCode.FAILED
    for system in _systems(latches, ""):
        if system.info.robot == chosen[0].robot or not chosen[0].has_content:
            system.release()
    return _released(chosen[0].source or chosen[0].robot)


def release_held(systems: list[EstopTarget]) -> int:
    """Release e-stops that are no files, which supervisors remember."""
    held = [system for system in systems if system.release(held_only=True)]
    if not held:
        sys.stdout.write("no e-stop is latched\n")
        return ExitCode.OK
    return _released(", ".join(system.info.source for system in held))


def _released(what: str) -> ExitCode:
    sys.stdout.write(f"released: {what}\nTorque is still off. Run `joshua resume NODE` to re-enable it.\n")
    return ExitCode.OK


def _systems(latches: Latches, word: str) -> list[EstopTarget]:
    """Every system of this user, or the one that a word names, even if its supervisor was killed."""
    from joshua.cli.estop import EstopTarget
    from joshua.ipc.client import all_systems

    path = os.path.abspath(word)  # noqa: PTH100 (links stay as they are)
    found = []
    for base in latches:
        with contextlib.suppress(OSError):  # a folder that cannot be read must not keep the others running
            found += all_systems(base)
    return [
        EstopTarget(folder, info)
        for folder, info in found
        if not word or word in (info.source, str(info.process_id)) or path == info.source
    ]


def _lost(latches: Latches) -> list[ProcessMark]:
    """Guardians of runs whose folder has vanished."""
    from joshua.cli.lost_guardians import lost_guardians  # only here: a latch waits for no other import

    return lost_guardians(latches)


def _starting(latches: Latches, word: str) -> list[EstopTarget]:
    """Wait for systems that are starting, if none runs."""
    from joshua.supervisor.starting import started_processes

    waited_s = 0.0
    while not _systems(latches, ""):
        if waited_s >= (STARTED_S if started_processes(list(latches)) else STARTING_S):
            break
        time.sleep(POLL_S)
        waited_s += POLL_S
    return _systems(latches, word)


def _started_beside(latches: Latches, stopped: list[EstopTarget]) -> list[EstopTarget]:
    """Wait for systems that were starting while others were stopped."""
    from joshua.supervisor.starting import started_processes

    def process_ids(systems: list[EstopTarget]) -> set[int]:
        return {item.info.process_id for item in systems}

    waited_s = 0.0
    while waited_s < STARTED_S and started_processes(list(latches)) - process_ids(_systems(latches, "")):
        time.sleep(POLL_S)
        waited_s += POLL_S
    return [item for item in _systems(latches, "") if item.info.process_id not in process_ids(stopped)]


def _show(outcomes: list[Outcome]) -> ExitCode:
    from joshua.cli.estop import lines

    for outcome in outcomes:
        latched = "latched" if outcome.lasting else "not latched"
        sys.stdout.write(f"e-stop {latched}: {outcome.title}\n")
        sys.stdout.writelines(f"{line}\n" for line in lines(outcome.reports, outcome.roads))
    if all(outcome.lasting for outcome in outcomes):
        sys.stdout.write("Torque stays off until you run: joshua estop --release\n")
    else:
        sys.stdout.write(
            "The e-stop does not last: a start or `joshua resume` enables torque. Make the folder of the "
            "latch writable, then run: joshua estop\n"
        )
    good = all(report.complete for outcome in outcomes for report in outcome.reports)
    return ExitCode.OK if good else ExitCode.HARDWARE
