"""Stops the actuators of a run: its drivers, else their guardians, else this program itself."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.guardian.latch import FOLDER_NAME, EstopFiles, EstopReport
from joshua.ipc.client import CallError, RunInfo, RunningSystem

if TYPE_CHECKING:
    from joshua.guardian.latch import Latch, LatchFolder, Subject


#: After this time a device whose driver and guardian have not answered is opened here.
DIRECT_AFTER_S = 1.5

#: A supervisor that lives answers in milliseconds; nothing depends on its answer.
SUPERVISOR_TIMEOUT_S = 0.5

_POLL_S = 0.01
#: What one turn counts at most: while this program stood still, drivers mostly could not answer either.
_TURN_S = 0.1


class EstopTarget(RunningSystem):
    """The actuators of one run, alive or killed.

    Args:
        path: directory of the run; info: what it holds.
    """

    def __init__(self, path: Path, info: RunInfo) -> None:
        super().__init__(path, info)
        self._files = EstopFiles(str(path / FOLDER_NAME))
        # A run that ends meanwhile takes its directory along.
        self._orders = {node: self._files.read_order(node) for node in info.actuators}
        self._reached: dict[str, EstopReport | None] = {}

    @property
    def base(self) -> Path:
        """The base at which the run keeps its directory, and beside it its latches."""
        return self.path.parents[1]

    def concerns(self, subject: Subject) -> bool:
        """Whether an actuator of another file belongs to the robot of this run."""
        same_node = (self.info.domain_id, True) == (subject.domain_id, subject.node in self.info.actuators)
        return same_node or bool(self.info.robot and self.info.robot == subject.robot)

    def notify(self, *, released: bool = False) -> str:
        """Has the run's log say what happened; returns why that failed, "" where it did not."""
        request = {"request": "estop", "released": released, "process_id": os.getpid()}
        try:
            self.request(request, SUPERVISOR_TIMEOUT_S)
        except CallError as error:
            return str(error.__cause__ or error) or type(error).__name__
        return ""

    def wait(self, latch: Latch, latches: LatchFolder, timeout_s: float) -> list[EstopReport]:
        """Waits until every actuator has confirmed; returns what became of each, in the run's order.

        Args:
            latches: where a later e-stop of the same run may have taken the place of this one.
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
        """What is known of an actuator; what this program has reached counts where it is more."""
        found = [self._files.read_report(node, latch) for latch in latches]
        report, own = next((item for item in found if item is not None), None), self._reached.get(node)
        return own if own is not None and (own.complete or report is None) else report

    def _reach(self, node: str, latch: Latch) -> None:
        """Releases an actuator from here, with what its driver has left for that; once."""
        order = self._files.read_order(node) or self._orders[node]
        if order is not None and node not in self._reached:
            self._reached[node] = None
            threading.Thread(target=self._act, args=(node, latch, *order), daemon=True).start()

    def _act(self, node: str, latch: Latch, implementation: str, request: dict[str, object]) -> None:
        from joshua.guardian.main import load_action

        try:
            result = load_action(implementation)(request)
        except Exception as error:  # noqa: BLE001 (a plugin's code; the command must report)
            result = {"complete": False, "detail": f"{type(error).__name__}: {error}"}
        complete = bool(result.get("complete"))
        joints = {str(joint): str(state) for joint, state in dict(result.get("joints", {})).items()}
        self._reached[node] = EstopReport(
            latch.identifier, node, "command", complete, complete, joints, str(result.get("detail", ""))
        )

    def _unreached(self, node: str, latch: Latch) -> EstopReport:
        if self._orders[node] is None:
            detail = "its driver does not answer, and has not opened the device in this run"
        else:
            detail = "neither its driver nor its guardian answers, and the device cannot be opened"
        return EstopReport(latch.identifier, node, "command", False, False, {}, detail)


_BY = {"driver": "its driver", "guardian": "its guardian", "command": "this command"}


def lines(reports: Sequence[EstopReport]) -> list[str]:
    """One line for each actuator: whether its torque is off, who has seen to it, and how that is known."""
    from joshua.supervisor.tables import clean, columns

    rows = [("  ACTUATOR", "TORQUE", "")]
    rows += [(f"  {report.node}", _torque(report), _how(report)) for report in reports]
    return [clean(line) for line in columns(rows)]


def _torque(report: EstopReport) -> str:
    if not report.complete:
        return "UNKNOWN"
    return "off" if report.verified else "off (not read back)"


def _how(report: EstopReport) -> str:
    by = _BY.get(report.by, report.by)
    if not report.complete:
        confirmed = [joint for joint, state in report.joints.items() if state in ("released", "was off")]
        partly = f"released are only {', '.join(confirmed)}; " if confirmed else ""
        reason = (report.detail or "the device did not confirm").rstrip(".")
        return f"could not be reached: {partly}{reason}; cut its supply by hand"
    if report.verified:
        return f"read back from {len(report.joints)} joints by {by}"
    return f"told by {by}; the device cannot say whether it is"
