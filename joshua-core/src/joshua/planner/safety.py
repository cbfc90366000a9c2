"""What the plan says about the safe state of an actuator."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from joshua.plan import Severity
from joshua.planner.devices import Wanted
from joshua.planner.diagnostics import Diagnostics
from joshua.plugins import ActuatorSpec
from joshua.schema import config_pb2 as pb

if TYPE_CHECKING:
    from joshua.plan import JointRange

PARK_TIMEOUT_S = 5.0
ON_STALE_AFTER_S = 5.0

#: Beyond the time for parking: the guardian's own, its report, and the closing of the device.
STOP_MARGIN_S = 6.0


def safety_facts(action: pb.SingleAction, spec: ActuatorSpec) -> dict[str, Any]:
    """Facts about the safe state of an actuator, the action of its guardian and of an e-stop."""
    from joshua.plan import OnStale, SafeStop

    is_leader = action.action_type == pb.ACTION_LEADER
    state = action.safe_state or (pb.RELEASE if is_leader else pb.HOLD)
    name = pb.SafeState.Name(state) if state in pb.SafeState.values() else "HOLD"
    facts: dict[str, Any] = {
        "safe_state": name,
        "estop_action": spec.safe_stop,
        "keeps_last_goal": not (spec.safe_stop or spec.stops_itself or spec.virtual),
    }
    timeout_s = float(action.park_timeout_s) if action.HasField("park_timeout_s") else PARK_TIMEOUT_S
    pose = tuple(action.park_pose_rad)
    if not is_leader and action.on_stale in (pb.RELEASE, pb.PARK_THEN_RELEASE):
        after_s = float(action.on_stale_after_s) if action.HasField("on_stale_after_s") else ON_STALE_AFTER_S
        facts["on_stale"] = OnStale(pb.SafeState.Name(action.on_stale), after_s, pose, timeout_s)
    if not is_leader and spec.safe_stop:
        facts["safe_stop"] = SafeStop(spec.safe_stop, name, pose, timeout_s)
        # Not only for parking: a guardian that looks for a device which is gone takes its time, too.
        facts["stop_timeout_s"] = timeout_s + STOP_MARGIN_S
    return facts


def check_safety(
    want: Wanted, spec: ActuatorSpec, joints: Sequence[JointRange], findings: Diagnostics
) -> None:
    """Finds a park pose that does not fit the joints, and a device that cannot park."""
    action = want.entry.owner
    if not isinstance(action, pb.SingleAction):
        return
    path = want.entry.owner_path
    has_guardian = bool(spec.safe_stop) and action.action_type != pb.ACTION_LEADER
    parks_when_stale = action.on_stale == pb.PARK_THEN_RELEASE
    if action.HasField("park_timeout_s") and not (has_guardian or parks_when_stale):
        findings.add(
            "field-unused",
            Severity.NOTE,
            f"park_timeout_s has no effect: {want.entry.node.node_name} has no guardian that it could bound",
            f"{path}.park_timeout_s",
            remedy="remove it",
        )
    parks = action.safe_state == pb.PARK_THEN_RELEASE
    if parks and not spec.safe_stop:
        findings.add(
            "safe-state-unfit",
            Severity.ERROR,
            f"{want.entry.node.node_name}: the plugin of {want.block_name or want.enum_value} cannot park",
            f"{path}.safe_state",
            found="PARK_THEN_RELEASE",
            allowed=("HOLD", "RELEASE"),
            remedy="write safe_state: HOLD or safe_state: RELEASE",
        )
    elif (parks or parks_when_stale) and action.park_pose_rad and len(action.park_pose_rad) != len(joints):
        names = ", ".join(joint.name for joint in joints)
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
