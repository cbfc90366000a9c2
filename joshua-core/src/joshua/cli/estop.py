"""Disable the torque of actuators: by their drivers, else by their guardians, else by this program itself."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.guardian.latch import FOLDER_NAME, EstopFiles, EstopReport, Latch, LatchFolder
from joshua.ipc.client import CallError, RunInfo, RunningSystem
from joshua.supervisor.run_directory import latch_folder

if TYPE_CHECKING:
    from joshua.guardian.latch import Subject
    from joshua.plan import NodeSpec

#: Time for one device that no run uses.
OFFLINE_TIMEOUT_S = 2.0

#: After this time a device is opened here if its driver and its guardian have not answered.
DIRECT_AFTER_S = 1.5

#: A running supervisor responds within milliseconds. Nothing depends on its response.
SUPERVISOR_TIMEOUT_S = 0.5

_POLL_S = 0.01
#: Upper limit of a turn's time, because a system stall delays the drivers as well.
_TURN_S = 0.1


class EstopTarget(RunningSystem):
    """The actuators of one run, even if its supervisor was killed."""

    def __init__(self, path: Path, info: RunInfo) -> None:
        super().__init__(path, info)
        self._files = EstopFiles(str(path / FOLDER_NAME))
        # A run that ends removes its directory.
        self._orders = {node: self._files.read_order(node) for node in info.actuators}
        self._reached: dict[str, EstopReport | None] = {}

    @property
    def base(self) -> Path:
        """The base of the run's directory and latches."""
        return self.path.parents[1]

    def concerns(self, subject: Subject) -> bool:
        """Whether an actuator of another file belongs to the robot of this run."""
        same_node = (self.info.domain_id, True) == (subject.domain_id, subject.node in self.info.actuators)
        return same_node or bool(self.info.robot and self.info.robot == subject.robot)

    def notify(self, *, released: bool = False) -> str:
        """Make the run log the e-stop. Returns why that failed, "" on success."""
        request = {"request": "estop", "released": released, "process_id": os.getpid()}
        try:
            self.request(request, SUPERVISOR_TIMEOUT_S)
        except CallError as error:
            return str(error.__cause__ or error) or type(error).__name__
        return ""

    def wait(self, latch: Latch, latches: LatchFolder, timeout_s: float) -> list[EstopReport]:
        """Wait until every actuator has confirmed. Returns one report each, in the run's order.

        Args:
            latches: may hold a later e-stop of the same run, which counts as well.
        """
        last_s, elapsed_s = time.monotonic(), 0.0
        nodes = self.info.actuators
        while True:
            later = [item.identifier for item in latches.all() if item.source == latch.source]
            reports = {node: self._report(node, [latch.identifier, *later]) for node in nodes}
            waiting = [node for node, report in reports.items() if report is None or not report.complete]
            now_s = time.monotonic()
            last_s, elapsed_s = now_s, elapsed_s + min(now_s - last_s, _TURN_S)
            if not waiting or elapsed_s > timeout_s:
                return [reports[node] or self._unreached(node, latch) for node in nodes]
            if elapsed_s > DIRECT_AFTER_S or not self.path.exists():
                for node in waiting:
                    self._reach(node, latch)
            time.sleep(_POLL_S)

    def _report(self, node: str, latches: Sequence[str]) -> EstopReport | None:
        """The report on an actuator; that of this program if it has more information."""
        found = [self._files.read_report(node, latch) for latch in latches]
        report, own = next((item for item in found if item is not None), None), self._reached.get(node)
        return own if own is not None and (own.complete or report is None) else report

    def _reach(self, node: str, latch: Latch) -> None:
        """Release an actuator from here, once, with the order stored by its driver."""
        order = self._files.read_order(node) or self._orders[node]
        if order is not None and node not in self._reached:
            self._reached[node] = None
            threading.Thread(target=self._act, args=(node, latch, *order), daemon=True).start()

    def _act(self, node: str, latch: Latch, implementation: str, request: dict[str, object]) -> None:
        from joshua.guardian.main import load_action

        self._reached[node] = reported(node, latch, lambda: load_action(implementation)(request))

    def _unreached(self, node: str, latch: Latch) -> EstopReport:
        if self._orders[node] is None:
            detail = "its driver does not answer and has not opened the device in this run"
        else:
            detail = "neither its driver nor its guardian answers, and the device cannot be opened"
        return EstopReport(latch.identifier, node, "command", False, False, {}, detail)


def user_latches(bases: Sequence[Path]) -> dict[Path, LatchFolder]:
    """The latches of a user at every base where systems may run, as ``base_directories`` lists them."""
    return {base: LatchFolder(latch_folder(base)) for base in bases}


def set_latch(
    latches: Mapping[Path, LatchFolder],
    base: Path,
    robot: str,
    source: str,
    domain_id: int,
    nodes: Sequence[str],
) -> Latch:
    """Latch actuators at a base, and at the others too, because the next run may use another base.

    Raises:
        OSError: it cannot be set at that base.
    """
    latch = latches[base].set(robot, source, domain_id, nodes)
    for other, folder in latches.items():
        if other != base:
            with contextlib.suppress(OSError):  # then no run can start there either
                folder.set(robot, source, domain_id, nodes)
    return latch


def release_offline(spec: NodeSpec, latch: Latch) -> EstopReport:
    """Release an actuator that no run uses, and read back its torque, because an arm may hold after a run."""
    return reported(spec.full_name, latch, lambda: _release(spec))


def reported(node: str, latch: Latch, act: Callable[[], Mapping[str, Any]]) -> EstopReport:
    """Run an action that releases an actuator. Returns its report, also if it failed."""
    try:
        result = act()
    except Exception as error:  # noqa: BLE001 (a plugin's code; the command must report)
        result = {"detail": f"{type(error).__name__}: {error}" if str(error) else type(error).__name__}
    complete = bool(result.get("complete"))
    verified = complete and bool(result.get("verified", True))
    joints = {str(joint): str(state) for joint, state in dict(result.get("joints", {})).items()}
    detail = str(result.get("detail", ""))
    return EstopReport(latch.identifier, node, "command", complete, verified, joints, detail)


def _release(spec: NodeSpec) -> dict[str, Any]:
    from joshua.devices.context import open_driver
    from joshua.guardian.main import load_action
    from joshua.plan import ActuatorFacts

    actuator = open_driver(spec)
    if action := spec.facts_as(ActuatorFacts).estop_action:
        request = actuator.safe_stop_request("RELEASE", timeout_s=OFFLINE_TIMEOUT_S)
        return load_action(action)(request.to_values())
    actuator.connect()
    try:
        actuator.release()
        torque = actuator.read_torque()
    finally:
        actuator.disconnect()
    on = [joint for joint, has_torque in (torque or {}).items() if has_torque]
    return {
        "complete": not on,
        "verified": torque is not None,
        "joints": {joint: "has torque" if joint in on else "released" for joint in torque or {}},
        "detail": f"{', '.join(on)} still has torque" if on else "",
    }


_BY = {"driver": "its driver", "guardian": "its guardian", "command": "this command"}


def lines(reports: Sequence[EstopReport]) -> list[str]:
    """One line for each actuator: whether its torque is off, and the source of that information."""
    from joshua.supervisor.tables import Screen, columns

    if not reports:
        return ["  it has no actuators"]
    rows = [("  ACTUATOR", "TORQUE", "")]
    rows += [(f"  {report.node}", _torque(report), _how(report)) for report in reports]
    return columns(rows, screen=Screen.of(sys.stdout), flexible=2)


def _torque(report: EstopReport) -> str:
    from joshua.supervisor.tables import RED, Cell

    if not report.complete:
        return Cell.of("UNKNOWN", RED)
    return "off" if report.verified else "off (not read back)"


def _how(report: EstopReport) -> str:
    by = _BY.get(report.by, report.by)
    if not report.complete:
        confirmed = [joint for joint, state in report.joints.items() if state in ("released", "was off")]
        partly = f"only {', '.join(confirmed)} confirmed; " if confirmed else ""
        reason = (report.detail or "the device did not confirm").rstrip(".")
        return f"not confirmed: {partly}{reason}. Cut its power by hand"
    if report.verified:
        return f"read back from {len(report.joints)} joints by {by}"
    return f"reported by {by}; the device has no torque to read back"
