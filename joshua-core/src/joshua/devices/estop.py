"""An e-stop as the node of an actuator obeys it: no torque, read back, and a report of what was reached."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from joshua.devices.actuator import Actuator
from joshua.devices.errors import DeviceError
from joshua.guardian.estop_files import EstopFiles, EstopReport
from joshua.guardian.latch import Latch, LatchFolder, Subject
from joshua.node.behaviour import NodeContext


class Estop:
    """The e-stops of one node.

    Keys of ``NodeSpec.context`` that it uses: ``latch_folder``, without which there is no e-stop;
    ``estop_files``, ``robot``, ``domain_id``.
    """

    def __init__(self, context: NodeContext) -> None:
        values: dict[str, Any] = context.spec.context
        self._node = context.spec.full_name
        folder = values.get("latch_folder", "")
        self._latches = LatchFolder(Path(folder)) if folder else None
        self._subject = Subject(values.get("robot", ""), values.get("domain_id", 0), self._node)
        self._files = EstopFiles(values.get("estop_files", ""))

    def latch(self) -> Latch | None:
        """The e-stop that stands, if any; some microseconds."""
        return None if self._latches is None else self._latches.standing(self._subject)

    def leave_order(self, implementation: str, request: dict[str, Any]) -> None:
        """Leaves what releases the joints without this process."""
        self._files.leave_order(self._node, implementation, request)

    def left_order(self) -> dict[str, Any]:
        """What the driver before this one has left for that in the same run; empty where there was none."""
        order = self._files.read_order(self._node)
        return {} if order is None else order[1]

    def release(self, actuator: Actuator, latch: Latch, *, guarded: bool) -> str:
        """Takes the torque off, reads it back and reports; returns what the device has said.

        Args:
            guarded: whether a guardian takes over, and reports, where this fails.

        Raises:
            DeviceError: the device does not say that its torque is off.
        """
        try:
            actuator.release()
            torque = actuator.read_torque()
            on = [joint for joint, has_torque in (torque or {}).items() if has_torque]
            if on:
                raise DeviceError(f"{', '.join(on)} still has torque: cut the supply by hand")
        except DeviceError as error:
            if not guarded:
                self._report(latch, complete=False, verified=False, detail=str(error))
            raise
        joints = dict.fromkeys(torque or (), "released")
        self._report(latch, complete=True, verified=torque is not None, joints=joints)
        if torque is None:
            return "torque taken off; the device cannot say whether it is"
        return f"torque off, read back from {len(joints)} joints"

    def _report(
        self,
        latch: Latch,
        *,
        complete: bool,
        verified: bool,
        joints: dict[str, str] | None = None,
        detail: str = "",
    ) -> None:
        self._files.report(
            EstopReport(latch.identifier, self._node, "driver", complete, verified, joints or {}, detail)
        )
