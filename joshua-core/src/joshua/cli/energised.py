"""Actuators that keep their torque after their run, as read from them, and how to release them."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.guardian.energised import EnergisedFolder, EnergisedRecord, energised_folder

if TYPE_CHECKING:
    import argparse

    from joshua.guardian.latch import EstopReport, Latch

#: Time to read the torque of one device. A port that another process uses is awaited for as long.
LOOK_S = 0.5

#: The same after a run, whose guardians may still be at work.
AFTER_RUN_S = 3.0

#: Time to release one device.
RELEASE_S = 2.0


@dataclass(frozen=True)
class LeftEnergised:
    """An actuator that no run drives and that has torque, as far as known.

    Attributes:
        record: of its run.
        on: joints that have torque, as read; () if it was not read.
        joints: number of joints that were read, 0 if it was not read.
        problem: why it was not read.
        kept: what its guardian did and could not log; "" for nothing.
    """

    record: EnergisedRecord
    on: tuple[str, ...] = ()
    joints: int = 0
    problem: str = ""
    kept: str = ""

    @property
    def state(self) -> str:
        """What is known, for a person."""
        return f"{self._torque} ({self.kept})" if self.kept else self._torque

    @property
    def _torque(self) -> str:
        record = self.record
        if not self.joints:
            return (
                f"{record.node} got torque at {record.since} and was not released since; "
                f"it cannot be read: {self.problem.rstrip('.')}"
            )
        if len(self.on) == self.joints:
            return f"{record.node} holds its position with torque"
        return f"{record.node} has torque at {', '.join(self.on)}"


def recorded(bases: Iterable[Path]) -> list[tuple[EnergisedFolder, EnergisedRecord]]:
    """Records of actuators whose run has ended or was killed."""
    from joshua.ipc.client import LOCK_NAME, is_free

    return [
        (folder, record)
        for base in bases
        for folder in [EnergisedFolder(energised_folder(base))]
        for record in folder.all()
        if is_free(base / "runs" / record.run / LOCK_NAME)
    ]


def left_energised(
    bases: Iterable[Path],
    concerns: Callable[[EnergisedRecord], bool] = lambda _record: True,
    timeout_s: float = LOOK_S,
) -> list[LeftEnergised]:
    """Actuators that have torque without a run. Removes the records of those that have none.

    Args:
        bases: directories of this user's runs.
        concerns: which records count.
        timeout_s: for each device.
    """
    bases, found = list(bases), []
    is_starting = _run_is_starting(bases)
    for folder, record in recorded(bases):
        if not concerns(record):
            continue
        kept = _kept(folder, record)
        if is_starting:  # it may open the device at any moment, and would find it in use
            found.append(LeftEnergised(record, problem="a run is starting or does not answer", kept=kept))
            continue
        try:
            torque = _read(record, timeout_s)
        except Exception as error:  # noqa: BLE001 (a plugin's code; the command must report)
            found.append(LeftEnergised(record, problem=str(error) or type(error).__name__, kept=kept))
            continue
        on = tuple(joint for joint, has_torque in torque.items() if has_torque)
        if on:
            found.append(LeftEnergised(record, on, len(torque), kept=kept))
        else:
            _forget(folder, record)
    return found


def _kept(folder: EnergisedFolder, record: EnergisedRecord) -> str:
    """What a guardian did and could not log, because the disk was full and no supervisor answered."""
    from joshua.guardian.latch import FOLDER_NAME, NO_LATCH, EstopFiles

    run = folder.path.parent / "runs" / record.run
    report = EstopFiles(str(run / FOLDER_NAME)).read_report(record.node, NO_LATCH)
    return report.detail if report is not None else ""


def _run_is_starting(bases: Sequence[Path]) -> bool:
    """Whether a run of this user has no directory yet, or its nodes are not ready."""
    from joshua.ipc.client import CallError, RunningSystem, all_systems
    from joshua.supervisor.starting import started_processes

    started = started_processes(bases)
    if not started:
        return False
    systems = [RunningSystem(path, info) for base in bases for path, info in all_systems(base)]
    for system in systems:
        if system.info.process_id in started:
            try:
                is_ready = system.status().phase != "starting"
            except CallError:
                continue  # it is ending, or does not answer
            if is_ready:
                started.discard(system.info.process_id)
    return bool(started)


def left_lines(left: Sequence[LeftEnergised]) -> list[str]:
    """One line for each file: what its actuators do, and the command that releases them."""
    files: dict[tuple[str, tuple[str, ...]], list[LeftEnergised]] = {}
    for item in left:
        files.setdefault((item.record.source, item.record.options), []).append(item)
    lines = []
    for (source, options), items in files.items():
        states = "; ".join(item.state for item in items)
        which = "it" if len(items) == 1 else "them"
        command = shown_command("estop", source, options)
        lines.append(f"{states}. To release {which}, which lets {which} sink: {command}")
    return lines


def plan_options(arguments: argparse.Namespace) -> tuple[str, ...]:
    """The words of a command line that change what its file says."""
    words = [word for value in arguments.overrides or () for word in ("--set", value)]
    words += ["--host", arguments.host] if arguments.host else []
    words += [word for name in arguments.blocked_plugins or () for word in ("--block-plugin", name)]
    return tuple(words)


def shown_command(command: str, source: str, options: Sequence[str]) -> str:
    """A command for a file, as a line for the shell."""
    return " ".join(["joshua", command, shown_path(source), *map(shlex.quote, options)])


def shown_path(source: str) -> str:
    """A file as a word of the shell: relative if it is below the current directory."""
    try:
        relative = os.path.relpath(source)
    except (OSError, ValueError):  # the current directory was removed
        relative = os.pardir
    return shlex.quote(source if relative.startswith(os.pardir) else relative)


def release_recorded(
    bases: Iterable[Path], latch: Latch, records: Sequence[EnergisedRecord]
) -> list[EstopReport]:
    """Release recorded actuators without their drivers, and read back their torque."""
    from joshua.cli.estop import reported

    reports = []
    for folder, record in recorded(bases):
        if record in records:
            report = reported(record.node, latch, partial(_release, record))
            if report.complete:
                _forget(folder, record)
            reports.append(report)
    return reports


def forget_released(bases: Iterable[Path], source: str, reports: Iterable[EstopReport]) -> None:
    """Remove the records of actuators that an e-stop has released, as read back."""
    released = [report.node for report in reports if report.complete]
    for base in bases:
        folder = EnergisedFolder(energised_folder(base))
        for record in folder.all():
            if record.source == source and record.node in released:
                _forget(folder, record)


def _read(record: EnergisedRecord, timeout_s: float) -> dict[str, bool]:
    """Torque of each joint. Raises what the device raises."""
    from joshua.guardian.main import load_request
    from joshua.guardian.safe_stop import SafeStopRequest

    torque = None
    if record.implementation:
        request: SafeStopRequest = load_request(record.implementation).from_values(record.request)
        torque = replace(request, timeout_s=timeout_s).read_torque()
    if torque is None:
        raise NotImplementedError("its plugin cannot read the torque without its driver")
    return dict(torque)


def _release(record: EnergisedRecord) -> dict[str, Any]:
    from joshua.guardian.main import load_action

    if not record.implementation:
        return {
            "detail": "it cannot be released without its driver. Run "
            + shown_command("estop", record.source, record.options)
        }
    return load_action(record.implementation)({**record.request, "timeout_s": RELEASE_S})


def _forget(folder: EnergisedFolder, record: EnergisedRecord) -> None:
    try:
        folder.remove(record)
    except OSError:
        return  # it is read again next time
