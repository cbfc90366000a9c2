"""The safe state of an actuator, for its node: applied here or by the guardian."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from joshua.devices.actuator import Actuator
from joshua.devices.errors import DeviceError
from joshua.guardian import standby
from joshua.guardian.energised import EnergisedNote, EnergisedRecord
from joshua.guardian.latch import EstopFiles, EstopOrder, EstopReport, Latch, LatchFolder, Subject
from joshua.guardian.link import GuardianError, GuardianLink
from joshua.guardian.order import HANG_LIMIT_S, GuardianOrder
from joshua.ipc.process_mark import ProcessMark
from joshua.node.context import NodeContext
from joshua.plan import ActuatorFacts, SafeStop

#: Time limit of an e-stop that acts on a device without its driver.
ESTOP_TIMEOUT_S = 2.0

#: Interval of looking whether the files of the e-stop are still there.
FILES_PERIOD_S = 1.0

HOLD, RELEASE, PARK = "HOLD", "RELEASE", "PARK_THEN_RELEASE"


class ActuatorSafety:
    """Safe state and guardian of one node.

    Attributes:
        in_doubt: the driver does not know which joints have torque. Their guardian finds out.
    """

    def __init__(self, context: NodeContext) -> None:
        self._context = context
        self._facts = context.spec.facts_as(ActuatorFacts)
        self._state = self._facts.safe_state
        self._link: GuardianLink | None = None
        self._applied = ""
        run = self._facts.run
        self._node = context.spec.full_name
        self._latches = LatchFolder(Path(run.latch_folder)) if run.latch_folder else None
        self._subject = Subject(run.robot, run.domain_id, self._node)
        self._files = EstopFiles(run.estop_files)
        self._note = EnergisedNote("", "", EnergisedRecord(self._node, run.robot, run.source, 0, run.run))
        self._order: EstopOrder | None = None
        self._files_due_s = 0.0
        self.in_doubt = False

    def introduce(self, actuator: Actuator) -> None:
        """Stores what other programs need to release this open device without its driver.

        Raises:
            DeviceError: the record of its torque cannot be written. A restarted driver only warns.
        """
        action, request = self._facts.estop_action, {}
        if action:
            with contextlib.suppress(NotImplementedError):  # the error is reported when torque is requested
                request = actuator.safe_stop_request(RELEASE, timeout_s=ESTOP_TIMEOUT_S).to_values()
                self._order = EstopOrder(action, request)
                with contextlib.suppress(OSError):  # reported when torque is requested
                    self._leave_order()
        facts, run = self._facts, self._facts.run
        stays_energised = bool(request) or facts.keeps_last_goal
        if not stays_energised or facts.dry_run or facts.simulation is not None:
            return
        record = EnergisedRecord(
            node=self._node,
            robot=run.robot,
            source=run.source,
            domain_id=run.domain_id,
            run=run.run,
            implementation=action if request else "",
            request=request,
            options=run.options,
        )
        self._note = EnergisedNote(run.energised_folder, run.estop_files, record)
        try:
            self._note.prepare()
        except OSError as error:
            text = f"{self._node}: no record of its torque can be kept in {run.energised_folder}: "
            text += f"{error.strerror or error}. Free space, or set XDG_RUNTIME_DIR to another folder"
            if not facts.restarted:
                raise DeviceError(text) from error
            self._context.warn(text)

    def energising(self) -> None:
        """Records that the joints have torque from here on."""
        try:
            self._note.energising()
        except OSError as error:
            self._context.warn(
                f"{self._node}: if it keeps its torque after the run, `joshua status` cannot say so: "
                f"{error.strerror or error}"
            )

    def switch_off(self, actuator: Actuator) -> None:
        """Disables the torque of a device without a guardian. Raises what the device raises."""
        actuator.release()
        self.confirmed_off()

    def confirmed_off(self) -> None:
        """Notes that the device has confirmed that its torque is off."""
        self._note.released()

    def remembered(self) -> dict[str, Any]:
        """For a restarted driver: how the previous one in the same run reached the device."""
        order = self._files.read_order(self._node) if self._facts.restarted else None
        return {} if order is None else dict(order.request)

    def latch(self) -> Latch | None:
        """The latched e-stop, if any. Takes some microseconds."""
        stored = None if self._latches is None else self._latches.standing(self._subject)
        return stored or self._context.held_estop

    def prepare_estop(self) -> None:
        """Creates what an e-stop needs on a full file system. Raises DeviceError if that fails."""
        try:
            if self._latches is not None:
                self._latches.keep_spare()
            self._leave_order()
        except OSError as error:
            folder = self._facts.run.latch_folder
            raise DeviceError(
                f"{self._node}: the joints are not energised, because an e-stop might not be possible: "
                f"{error.filename or folder}: {error.strerror or error}. Free space there and try again"
            ) from error

    def keep_files(self) -> None:
        """Creates the files of an e-stop, and the record of torque, again if their folder has vanished."""
        now_s = time.monotonic()
        if now_s < self._files_due_s:
            return
        self._files_due_s = now_s + FILES_PERIOD_S
        with contextlib.suppress(OSError):  # the supervisor reports the folder
            if self._latches is not None:
                self._latches.keep_spare()
            self._note.keep()
            if not self._files.has_order(self._node):
                self._leave_order()

    def _leave_order(self) -> None:
        if self._order is None:
            return
        marks = [ProcessMark.of(os.getpid(), "driver")]
        if self._link is not None:
            marks.append(ProcessMark.of(self._link.process_id, "guardian"))
        processes = [mark.to_values() for mark in marks]
        self._files.leave_order(self._node, replace(self._order, processes=processes))

    def guard(self, actuator: Actuator) -> None:
        """Starts the guardian if the plan names its action. Raises DeviceError if it does not start."""
        stop, run = self._facts.safe_stop, self._facts.run
        if stop is None or self._facts.dry_run:
            return
        order = GuardianOrder(
            node=self._context.spec.full_name,
            implementation=stop.implementation,
            request=self._request(actuator, stop, stop.state),
            release_request=self._request(actuator, stop, RELEASE),
            timeout_s=stop.timeout_s,
            process_id=os.getpid(),
            thread_id=threading.get_native_id(),
            hang_limit_s=self._facts.hang_after_s or HANG_LIMIT_S,
            log=run.log,
            control_socket=run.socket,
            robot=run.robot,
            domain_id=run.domain_id,
            latch_folder=run.latch_folder,
            estop_files=run.estop_files,
            energised_record=self._note.path,
        )
        try:
            self._link = GuardianLink(order)
            self._link.armed()
        except GuardianError as error:
            raise DeviceError(
                f"{self._context.spec.full_name}: the joints are not energised, because the guardian that "
                f"would stop them in an emergency does not run: {error}"
            ) from error
        self._context.log.debug("guardian: process %d", self._link.process_id)
        with contextlib.suppress(OSError):  # the next look tries again
            self._leave_order()

    def apply(self, actuator: Actuator) -> None:
        """Applies the safe state, to be completed by ``finish``. Raises what the device raises."""
        if self._link is not None:
            self._say_stopping()
        if self.in_doubt and self._link is not None:
            return  # it acts as soon as the device is closed
        latch = self.latch()
        if latch is not None:
            self._release(actuator, latch)
            self._applied = RELEASE
        elif self._state == HOLD and not self.in_doubt:
            actuator.hold()
            self._applied = HOLD
        elif self._link is None or self._state == RELEASE:
            actuator.release()
            self._applied = RELEASE
            self.confirmed_off()
        # otherwise its guardian parks it as soon as the device is closed

    def stop_now(self, actuator: Actuator, latch: Latch) -> str:
        """Obeys an e-stop and returns the device's confirmation.

        Raises:
            DeviceError: it does not confirm that its torque is off. Then ``finish`` lets the guardian act.
        """
        if self._link is not None:
            with contextlib.suppress(GuardianError):  # the next line reports that it is gone
                self._link.release_only()  # the guardian cannot see an e-stop that is not a file
            self._say_stopping()
        said = self._release(actuator, latch)
        self.stand_down()
        return said

    def renew(self, actuator: Actuator) -> str:
        """After a failure, disable torque unless the safe state is HOLD. Return which joints have torque.

        The guardian of the previous driver gives up if it cannot reach the device. Raises DeviceError.
        """
        if self._state != HOLD:
            actuator.release()
            self.confirmed_off()
            return "with torque off"
        torque = actuator.read_torque()
        if torque is None:
            return "in the safe state HOLD"
        on = [joint for joint, has_torque in torque.items() if has_torque]
        if not on:
            self.confirmed_off()
        if len(on) == len(torque):
            return "holding its position"
        return f"with torque on at {', '.join(on)} only" if on else "with torque off"

    def stand_down(self) -> None:
        """Ends the guardian, because the device has confirmed that the joints have no torque."""
        link, self._link = self._link, None
        self.in_doubt = False
        self.confirmed_off()
        if link is not None:  # its end takes longer than the hang limit of a control loop
            threading.Thread(target=link.done, name="guardian's end", daemon=True).start()
        else:
            standby.forget(self._node)

    def before_torque_off(self) -> None:
        """Announces that the driver switches the torque off. If that fails, the guardian does it.

        Independent of the safe state: after a trip of a protection, and when commands have stopped.
        """
        self.in_doubt = True
        if self._link is not None:
            with contextlib.suppress(GuardianError):  # the failure of the node reports that it is gone
                self._link.release_only()
                self._link.stopping()

    def finish(self) -> None:
        """Ends the guardian, or lets it act if the driver could not. Raises DeviceError if that fails."""
        link, self._link = self._link, None
        if link is None:
            if self._applied:  # without its guardian, which was gone
                standby.forget(self._node)
            return
        if self._applied == RELEASE or (self._applied and self.latch() is None):
            link.done()
            return
        try:
            report = link.execute()
        except GuardianError as error:
            raise DeviceError(f"the safe state {self._state} is not verified: {error}") from error
        if not report.get("complete"):
            raise DeviceError(f"the safe state {self._state} is not verified: {report.get('detail', '')}")
        joints = ", ".join(f"{joint} {state}" for joint, state in report.get("joints", {}).items())
        state = report.get("action", self._state)
        self._context.log.info("safe state %s: %s %s", state, joints, report.get("detail", ""))

    def _release(self, actuator: Actuator, latch: Latch) -> str:
        """Switches the torque off, reads it back and reports. Returns the device's confirmation.

        Raises:
            DeviceError: the device does not confirm that. A guardian, if there is one, then acts and reports.
        """
        try:
            actuator.release()
            torque = actuator.read_torque()
            on = [joint for joint, has_torque in (torque or {}).items() if has_torque]
            if on:
                raise DeviceError(f"torque of {', '.join(on)} is still on: disconnect the power supply")
        except DeviceError as error:
            if self._link is None:
                self._report(latch, complete=False, verified=False, detail=str(error))
            raise
        self.confirmed_off()
        joints = dict.fromkeys(torque or (), "released")
        self._report(latch, complete=True, verified=torque is not None, joints=joints)
        if torque is None:
            return "torque switched off; the device cannot confirm it"
        return f"torque off, read back from {len(joints)} joints"

    def _report(self, latch: Latch, *, complete: bool, verified: bool, **more: Any) -> None:
        values = {"joints": {}, "detail": "", **more}
        report = EstopReport(latch.identifier, self._node, "driver", complete, verified, **values)
        self._files.report(report)
        self._context.estopped(report)

    def _request(self, actuator: Actuator, stop: SafeStop, action: str) -> dict[str, Any]:
        pose = stop.park_pose_rad if action == PARK else ()
        return actuator.safe_stop_request(action, park_pose_rad=pose, timeout_s=stop.timeout_s).to_values()

    def _say_stopping(self) -> None:
        assert self._link is not None
        try:
            self._link.stopping()
        except GuardianError as error:
            self._context.log.error("the guardian is gone, so the driver alone stops the joints: %s", error)
            self._link = None

    def beat(self) -> None:
        """Sends a heartbeat. Raises DeviceError if the guardian is gone."""
        if self._link is None:
            return
        try:
            self._link.beat()
        except GuardianError as error:
            raise DeviceError(
                f"{self._context.spec.full_name} stops, because nothing would stop it in an emergency: the "
                f"guardian is gone: {error}"
            ) from error
