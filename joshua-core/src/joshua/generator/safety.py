"""What the plan says about the safe state of an actuator."""

from __future__ import annotations

from typing import Any

from joshua.generator.devices import Wanted
from joshua.generator.findings import Findings
from joshua.plan import Severity
from joshua.plugins import Provision
from joshua.schema import config_pb2 as pb

PARK_TIMEOUT_S = 5.0

#: Beyond the time for parking: the guardian's own, its report, and the closing of the device.
STOP_MARGIN_S = 4.0


def safety_context(want: Wanted, provision: Provision) -> dict[str, Any]:
    """Safe state of an actuator, the action of its guardian and of an e-stop; empty for other nodes."""
    action = want.entry.owner
    if not isinstance(action, pb.SingleAction):
        return {}
    is_leader = action.action_type == pb.ACTION_LEADER
    state = action.safe_state or (pb.RELEASE if is_leader else pb.HOLD)
    name = pb.SafeState.Name(state) if state in pb.SafeState.values() else "HOLD"
    context: dict[str, Any] = {"safe_state": name}
    if provision.safe_stop:
        context["estop_action"] = provision.safe_stop
    if is_leader or not provision.safe_stop:
        return context
    timeout_s = float(action.park_timeout_s) if action.HasField("park_timeout_s") else PARK_TIMEOUT_S
    context["safe_stop"] = {
        "implementation": provision.safe_stop,
        "state": name,
        "park_pose_rad": list(action.park_pose_rad),
        "timeout_s": timeout_s,
    }
    # Not only for parking: a guardian that looks for a device which is gone takes its time, too.
    context["stop_timeout_s"] = timeout_s + STOP_MARGIN_S
    return context


def check_safety(
    want: Wanted, provision: Provision, joints: list[dict[str, Any]], findings: Findings
) -> None:
    """Finds a park pose that does not fit the joints, and a device that cannot park."""
    action = want.entry.owner
    if not isinstance(action, pb.SingleAction):
        return
    path = want.entry.owner_path
    has_guardian = bool(provision.safe_stop) and action.action_type != pb.ACTION_LEADER
    if action.HasField("park_timeout_s") and not has_guardian:
        findings.add(
            "field-unused",
            Severity.NOTE,
            f"park_timeout_s has no effect: {want.entry.node.node_name} has no guardian that it could bound",
            f"{path}.park_timeout_s",
            remedy="remove it",
        )
    if action.safe_state != pb.PARK_THEN_RELEASE:
        return
    if not provision.safe_stop:
        findings.add(
            "safe-state-unfit",
            Severity.ERROR,
            f"{want.entry.node.node_name}: the plugin of {want.block_name or want.enum_value} cannot park",
            f"{path}.safe_state",
            found="PARK_THEN_RELEASE",
            allowed=("HOLD", "RELEASE"),
            remedy="write safe_state: HOLD or safe_state: RELEASE",
        )
    elif action.park_pose_rad and len(action.park_pose_rad) != len(joints):
        names = ", ".join(joint["name"] for joint in joints)
        findings.add(
            "park-pose-unfit",
            Severity.ERROR,
            f"{want.entry.node.node_name}: the park pose has {len(action.park_pose_rad)} angles, "
            f"and the actuator has {len(joints)} joints: {names}",
            f"{path}.park_pose_rad",
            found=str(len(action.park_pose_rad)),
            allowed=(str(len(joints)),),
            remedy="write one angle for each joint, in radians and in this order",
        )
