"""What the plan says about the safe state of an actuator."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from joshua.planner.devices import Wanted
from joshua.plugins import ActuatorSpec
from joshua.schema import config_pb2 as pb

if TYPE_CHECKING:
    from joshua.plan import JointRange
    from joshua.planner.draft import Draft

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


def check_safety(draft: Draft, want: Wanted, spec: ActuatorSpec, joints: Sequence[JointRange]) -> None:
    """Find a park pose that does not fit the joints, and a device that cannot park."""
    action, path, name = want.entry.owner, want.entry.owner_path, want.entry.node.node_name
    has_guardian = bool(spec.safe_stop) and action.action_type != pb.ACTION_LEADER
    parks_when_stale = action.on_stale == pb.PARK_THEN_RELEASE
    found = draft.findings
    if action.HasField("park_timeout_s") and not (has_guardian or parks_when_stale):
        message = f"park_timeout_s has no effect: {name} has no guardian whose time it could limit"
        found.append(draft.note("field-unused", message, f"{path}.park_timeout_s"))
    parks = action.safe_state == pb.PARK_THEN_RELEASE
    if parks and not spec.safe_stop:
        message = f"{name}: the plugin of {want.block_name or want.enum_value} cannot park"
        allowed: tuple[str, ...] = ("HOLD", "RELEASE")
        found.append(draft.error("safe-state-unfit", message, f"{path}.safe_state", allowed=allowed))
    elif (parks or parks_when_stale) and joints and len(action.park_pose_rad) not in (0, len(joints)):
        names = ", ".join(joint.name for joint in joints)
        message = (
            f"{name}: the park pose has {len(action.park_pose_rad)} angles, "
            f"but the actuator has {len(joints)} joints: {names}"
        )
        allowed = (f"{len(joints)} angles",)
        found.append(draft.error("park-pose-unfit", message, f"{path}.park_pose_rad", allowed=allowed))
