"""The safe state of an actuator as its node sees it: applied here, or handed to the guardian."""

from __future__ import annotations

import json
import os
import threading
from typing import Any

from joshua.devices.actuator import Actuator
from joshua.devices.errors import DeviceError
from joshua.guardian.link import GuardianError, GuardianLink
from joshua.guardian.order import BEAT_S, GuardianOrder
from joshua.node.behaviour import NodeContext

HOLD, RELEASE, PARK = "HOLD", "RELEASE", "PARK_THEN_RELEASE"


class ActuatorSafety:
    """Safe state and guardian of one node.

    Keys of ``NodeSpec.context`` that it uses: ``safe_state``; ``safe_stop`` (``implementation``, ``state``,
    ``park_pose_rad``, ``timeout_s``), without which there is no guardian; ``run_log`` and ``run_socket``.
    """

    def __init__(self, context: NodeContext) -> None:
        self._context = context
        self._values: dict[str, Any] = context.spec.context
        self._state: str = self._values.get("safe_state", HOLD)
        self._link: GuardianLink | None = None
        self._stands = False

    def guard(self, actuator: Actuator) -> None:
        """Starts the guardian if the plan names its action. Raises DeviceError if it does not start."""
        stop = self._values.get("safe_stop")
        if not stop or self._values.get("dry_run"):
            return
        request = actuator.safe_stop_request(
            stop["state"], park_pose_rad=stop["park_pose_rad"], timeout_s=stop["timeout_s"]
        )
        order = GuardianOrder(
            node=self._context.spec.full_name,
            implementation=stop["implementation"],
            request=json.loads(request.to_json()),
            timeout_s=stop["timeout_s"],
            process_id=os.getpid(),
            thread_id=threading.get_native_id(),
            log=self._values.get("run_log", ""),
            control_socket=self._values.get("run_socket", ""),
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

    def create_timer(self) -> None:
        """Has the control loop show signs of life."""
        if self._values.get("safe_stop"):
            self._context.create_timer(BEAT_S, self.beat, name="guardian")

    def apply(self, actuator: Actuator) -> None:
        """Applies the safe state; ``finish`` does the rest. Raises what the device raises."""
        if self._link is not None:
            self._say_stopping()
        if self._link is not None and self._state == PARK:
            return  # its guardian parks it as soon as the device is closed
        if self._state == HOLD:
            actuator.hold()
        else:
            actuator.release()
        self._stands = True

    def finish(self) -> None:
        """Lets the guardian go, or act where the driver could not. Raises DeviceError if that fails."""
        link, self._link = self._link, None
        if link is None:
            return
        if self._stands:
            link.done()
            return
        try:
            report = link.execute()
        except GuardianError as error:
            raise DeviceError(f"the safe state {self._state} is not verified: {error}") from error
        if not report.get("complete"):
            raise DeviceError(f"the safe state {self._state} is not verified: {report.get('detail', '')}")
        joints = ", ".join(f"{joint} {state}" for joint, state in report.get("joints", {}).items())
        self._context.log.info("safe state %s: %s %s", self._state, joints, report.get("detail", ""))

    def _say_stopping(self) -> None:
        assert self._link is not None
        try:
            self._link.stopping()
        except GuardianError as error:
            self._context.log.error("the guardian is gone, so the driver alone stops the joints: %s", error)
            self._link = None

    def beat(self) -> None:
        """Shows a sign of life. Raises DeviceError if nobody guards any more."""
        if self._link is None:
            return
        try:
            self._link.beat()
        except GuardianError as error:
            raise DeviceError(
                f"{self._context.spec.full_name} stops, because nothing would stop it in an emergency: the "
                f"guardian is gone: {error}"
            ) from error
