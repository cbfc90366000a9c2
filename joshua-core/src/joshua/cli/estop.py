"""Disable the torque of actuators: by their drivers, else by their guardians, else by this program itself.

An e-stop takes three roads: the latch, the control socket of the run, and the device itself. Each is taken
whatever happens to the others. Light to import: the latch is set within a tenth of a second.

Why one file: the roads of one e-stop, and what is reported about them.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.guardian.latch import (
    FOLDER_NAME,
    EstopFiles,
    EstopOrder,
    EstopReport,
    Latch,
    LatchFolder,
    latch_folder,
    new_latch,
)
from joshua.ipc.client import SOCKET_NAME, CallError, RunInfo, RunningSystem, answers

if TYPE_CHECKING:
    from joshua.guardian.latch import Subject
    from joshua.ipc.process_mark import ProcessMark
    from joshua.plan import NodeSpec

#: Time for one device that no run uses.
OFFLINE_TIMEOUT_S = 2.0

#: After this time a device is opened here if its driver and its guardian have not answered.
DIRECT_AFTER_S = 1.5

#: The same if both are stopped or have ended.
STOPPED_AFTER_S = 0.1

#: A running supervisor responds within milliseconds. Nothing depends on its response.
SUPERVISOR_TIMEOUT_S = 0.5

#: Time for a killed process to end, which a device call may delay in the kernel.
END_TIMEOUT_S = 1.0

_POLL_S = 0.01
#: Upper limit of a turn's time, because a system stall delays the drivers as well.
_TURN_S = 0.1


@dataclass(frozen=True)
class LatchResult:
    """What became of a latch.

    Attributes:
        latch: as set, or as it would have been.
        stored: whether it is a file that drivers and guardians read; detail: where, or why not.
    """

    latch: Latch
    stored: bool
    detail: str


class SocketRoad:
    """Tells a run of an e-stop over its control socket and collects reports, on a thread.

    Args:
        system: the run; result: of its latch; timeout_s: for its answers.

    Attributes:
        reports: of the nodes that have reported.
        noted: whether the supervisor has passed it on.
    """

    def __init__(self, system: RunningSystem, result: LatchResult, timeout_s: float) -> None:
        self.reports: dict[str, EstopReport] = {}
        self.noted = False
        self._process_id = system.info.process_id
        self._problem = ""
        self._answered = threading.Event()
        self._began_s = time.monotonic()
        request = {
            "request": "estop",
            "latch": asdict(result.latch),
            "stored": result.stored,
            "process_id": os.getpid(),
        }
        arguments = (system.path / SOCKET_NAME, request, timeout_s)
        threading.Thread(target=self._follow, args=arguments, name="control socket", daemon=True).start()

    def detail(self) -> str:
        """What happened. Waits for the answer of a supervisor that is only slow."""
        self._answered.wait(max(0.0, self._began_s + SUPERVISOR_TIMEOUT_S - time.monotonic()))
        if self.noted:
            return f"process {self._process_id} told its nodes"
        reason = self._problem or f"no answer after {time.monotonic() - self._began_s:.1f} s"
        return f"the supervisor, process {self._process_id}, does not answer: {reason}"

    def _follow(self, path: Path, request: Mapping[str, Any], timeout_s: float) -> None:
        try:
            for answer in answers(path, request, timeout_s):
                if "report" in answer:
                    report = EstopReport(**answer["report"])
                    self.reports[report.node] = report
                    continue
                self.noted = bool(answer.get("noted"))
                self._problem = str(answer.get("error", ""))
                self._answered.set()
        except (OSError, ValueError, TypeError) as error:
            self._problem = getattr(error, "strerror", None) or str(error) or type(error).__name__
        self._answered.set()


class DeviceRoad:
    """Releases an actuator from this program, on a thread, with the order that its driver has stored.

    Its driver and its guardian hold the device. They have not responded, so they are killed.

    Args:
        node: the actuator; latch: of this e-stop; order: of its driver.

    Attributes:
        report: None until the device has answered.
    """

    def __init__(self, node: str, latch: Latch, order: EstopOrder) -> None:
        self.report: EstopReport | None = None
        self._node = node
        self._order = order
        self._kills: list[str] = []
        threading.Thread(target=self._run, args=(latch,), name=node, daemon=True).start()

    def detail(self) -> str:
        """What happened."""
        opened = "the device was opened here" if self.report is not None else "the device has not answered"
        return f"{self._node}: {', '.join([*self._kills, opened])}"

    def _run(self, latch: Latch) -> None:
        self.report = reported(self._node, latch, self._act)

    def _act(self) -> Mapping[str, Any]:
        from joshua.guardian.main import load_action

        action = load_action(self._order.implementation)  # first: it takes longest
        for mark in reversed(marks_of(self._order)):  # the guardian first, which might hold the joints
            if mark.state == "gone":
                continue
            if mark.kill(END_TIMEOUT_S, with_children=mark.name == "guardian"):
                self._kills.append(f"killed its {mark}")
            else:
                self._kills.append(f"its {mark} could not be killed")
        return action(dict(self._order.request))


def marks_of(order: EstopOrder) -> list[ProcessMark]:
    """The driver and the guardian that an order names."""
    from joshua.ipc.process_mark import ProcessMark

    marks = []
    for values in order.processes:
        with contextlib.suppress(TypeError):  # of another version
            marks.append(ProcessMark.from_values(values))
    return marks


class EstopTarget(RunningSystem):
    """The actuators of one run, even if its supervisor was killed."""

    def __init__(self, path: Path, info: RunInfo) -> None:
        super().__init__(path, info)
        self._files = EstopFiles(str(path / FOLDER_NAME))
        # A run that ends removes its directory.
        self._orders = {node: self._files.read_order(node) for node in info.actuators}
        self._latched: LatchResult | None = None
        self._socket: SocketRoad | None = None
        self._devices: dict[str, DeviceRoad] = {}
        self._reports: list[EstopReport] | None = None
        self._waiter: threading.Thread | None = None

    @property
    def base(self) -> Path:
        """The base of the run's directory and latches."""
        return self.path.parents[1]

    def concerns(self, subject: Subject) -> bool:
        """Whether an actuator of another file belongs to the robot of this run."""
        same_node = (self.info.domain_id, True) == (subject.domain_id, subject.node in self.info.actuators)
        return same_node or bool(self.info.robot and self.info.robot == subject.robot)

    def begin(self, latches: Mapping[Path, LatchFolder], timeout_s: float) -> None:
        """Latch the e-stop and tell the run. Watch the effect on a thread, beside those of other runs."""
        info = self.info
        self._latched = set_latch(latches, self.base, info.robot, info.source, info.domain_id, info.actuators)
        self._socket = SocketRoad(self, self._latched, timeout_s)
        arguments = (latches[self.base], timeout_s)
        self._waiter = threading.Thread(target=self._wait, args=arguments, name="effect", daemon=True)
        self._waiter.start()

    def release(self, *, held_only: bool = False) -> bool:
        """Tell the run that the e-stop is released. Returns whether it held one that is no file.

        Args:
            held_only: there is no file, so the run need not log the release of one.
        """
        request = {"request": "estop", "released": True, "held_only": held_only, "process_id": os.getpid()}
        try:
            return bool(self.request(request, SUPERVISOR_TIMEOUT_S).get("held"))
        except CallError:
            return False  # it reads the file, if there was one

    def reports(self) -> list[EstopReport]:
        """Wait until every actuator has confirmed. Returns one report each, in the run's order."""
        assert self._latched is not None
        assert self._waiter is not None
        self._waiter.join()
        if self._reports is not None:
            return self._reports
        return [self._unreached(node, self._latched.latch) for node in self.info.actuators]

    def _wait(self, latches: LatchFolder, timeout_s: float) -> None:
        """Collect the reports.

        Args:
            latches: may hold a later e-stop of the same run, which counts as well.
        """
        assert self._latched is not None
        latch = self._latched.latch
        last_s, elapsed_s = time.monotonic(), 0.0
        nodes = self.info.actuators
        while True:
            later = [item for item in latches.all() if item.source == latch.source or not item.has_content]
            accepted = [latch.identifier, *(item.identifier for item in later)]
            reports = {node: self._report(node, accepted) for node in nodes}
            waiting = [node for node, report in reports.items() if report is None or not report.complete]
            now_s = time.monotonic()
            last_s, elapsed_s = now_s, elapsed_s + min(now_s - last_s, _TURN_S)
            if not waiting or elapsed_s > timeout_s:
                self._reports = [reports[node] or self._unreached(node, latch) for node in nodes]
                return
            for node in waiting:
                if self._is_due(node, elapsed_s):
                    self._reach(node, latch)
            time.sleep(_POLL_S)

    def roads(self) -> list[tuple[str, str]]:
        """Each road of the e-stop and what happened there."""
        assert self._latched is not None
        assert self._socket is not None
        devices = [device.detail() for device in self._devices.values()] or ["not needed"]
        return [
            ("latch", self._latched.detail),
            ("control socket", self._socket.detail()),
            *(("device", detail) for detail in devices),
        ]

    @property
    def stays_off(self) -> bool:
        """Whether the e-stop lasts: it is a file, or the supervisor remembers it."""
        assert self._latched is not None
        assert self._socket is not None
        return self._latched.stored or self._socket.noted

    def _report(self, node: str, accepted: Sequence[str]) -> EstopReport | None:
        """The report on an actuator; that of this program if it has more information."""
        assert self._socket is not None
        found = [self._files.read_report(node, latch) for latch in accepted]
        told = self._socket.reports.get(node)
        found.append(told if told is not None and told.latch in accepted else None)
        report = next((item for item in found if item is not None), None)
        own = self._devices[node].report if node in self._devices else None
        return own if own is not None and (own.complete or report is None) else report

    def _order(self, node: str) -> EstopOrder | None:
        return self._files.read_order(node) or self._orders[node]

    def _is_due(self, node: str, elapsed_s: float) -> bool:
        """Whether to open a device here: driver and guardian are stopped or gone, or have had their time."""
        if elapsed_s > DIRECT_AFTER_S or not self.path.exists():
            return True
        if elapsed_s < STOPPED_AFTER_S:
            return False
        order = self._order(node)
        marks = [] if order is None else marks_of(order)
        return bool(marks) and all(mark.state in ("stopped", "gone") for mark in marks)

    def _reach(self, node: str, latch: Latch) -> None:
        """Release an actuator from here, once."""
        order = self._order(node)
        if order is not None and node not in self._devices:
            self._devices[node] = DeviceRoad(node, latch, order)

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
) -> LatchResult:
    """Latch actuators at a base, and at the others too, because the next run may use another base."""
    result = _set_at(latches[base], robot, source, domain_id, nodes)
    for other, folder in latches.items():
        if other != base:
            _set_at(folder, robot, source, domain_id, nodes)  # no run can start where it fails
    return result


def _set_at(
    folder: LatchFolder, robot: str, source: str, domain_id: int, nodes: Sequence[str]
) -> LatchResult:
    try:
        return LatchResult(folder.set(robot, source, domain_id, nodes), True, f"set in {folder.path}")
    except OSError as error:
        reason = error.strerror or str(error)
    latch = new_latch(robot, source, domain_id, nodes)
    try:
        latch = folder.set_without_space(latch)
    except OSError:
        return LatchResult(latch, False, f"not set in {folder.path}: {reason}")
    detail = f"set in {folder.path} by renaming a file ({reason})"
    if not latch.has_content:
        detail += "; it counts for every actuator of this user"
    return LatchResult(latch, True, detail)


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


def lines(reports: Sequence[EstopReport], roads: Sequence[tuple[str, str]] = ()) -> list[str]:
    """One line for each actuator: whether its torque is off, and the source of that information.

    Args:
        roads: of the e-stop, and what happened on each.
    """
    from joshua.supervisor.tables import Screen, columns

    screen = Screen.of(sys.stdout)
    shown = ["  it has no actuators"]
    if reports:
        rows = [("  ACTUATOR", "TORQUE", "")]
        rows += [(f"  {report.node}", _torque(report), _how(report)) for report in reports]
        shown = columns(rows, screen=screen, flexible=2)
    if roads:
        table = [("  ROAD", ""), *((f"  {road}", detail) for road, detail in roads)]
        shown += columns(table, screen=screen, flexible=1)
    return shown


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
