"""The safe state of an actuator and the settings that belong to it."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.config.checks.context import Context
from joshua.plan import Diagnostic
from joshua.schema import config_pb2 as pb


def check(context: Context) -> Iterator[Diagnostic]:
    """Finds a park without a pose, and settings that no safe state uses."""
    for entry in context.graph.entries:
        action = entry.owner
        if not isinstance(action, pb.SingleAction):
            continue
        path = entry.owner_path
        if action.action_type == pb.ACTION_LEADER and action.safe_state not in (0, pb.RELEASE):
            name = pb.SafeState.Name(action.safe_state) if action.safe_state <= pb.PARK_THEN_RELEASE else "it"
            yield context.error(
                "safe-state-unfit",
                f"A leader never has torque, so it cannot {'park' if 'PARK' in name else 'hold'}",
                f"{path}.safe_state",
                found=name,
                allowed=("RELEASE",),
            )
        elif action.safe_state == pb.PARK_THEN_RELEASE:
            yield from _pose(context, action, path, "safe_state")
        if action.action_type == pb.ACTION_LEADER or not entry.node.subscriptions:
            yield from _unused(context, action, path)
        elif action.on_stale == pb.PARK_THEN_RELEASE:
            yield from _pose(context, action, path, "on_stale")
        elif action.on_stale != pb.RELEASE and action.HasField("on_stale_after_s"):
            message = "on_stale_after_s has no effect: joints that hold go on holding"
            remedy = "Remove it, or set on_stale: RELEASE or on_stale: PARK_THEN_RELEASE"
            yield context.note("field-unused", message, f"{path}.on_stale_after_s", remedy=remedy)
        if action.park_pose_rad and pb.PARK_THEN_RELEASE not in (action.safe_state, action.on_stale):
            message = "park_pose_rad has no effect: it belongs to safe_state: PARK_THEN_RELEASE"
            remedy = "Remove it, or set safe_state: PARK_THEN_RELEASE"
            yield context.note("field-unused", message, f"{path}.park_pose_rad", remedy=remedy)


def _pose(context: Context, action: pb.SingleAction, path: str, field: str) -> Iterator[Diagnostic]:
    if not action.park_pose_rad:
        message = "PARK_THEN_RELEASE needs park_pose_rad, the pose in which the joints may lose their torque"
        yield context.error("park-pose-missing", message, f"{path}.{field}", found="PARK_THEN_RELEASE")


def _unused(context: Context, action: pb.SingleAction, path: str) -> Iterator[Diagnostic]:
    """Settings about commands where nobody commands: at a leader, and at what has no subscription."""
    name_of_node = action.node.node_name or "this actuator"
    for name, is_set in (
        ("on_stale", action.on_stale != 0),
        ("on_stale_after_s", action.HasField("on_stale_after_s")),
    ):
        if is_set:
            yield context.note(
                "field-unused", f"{name} has no effect: {name_of_node} follows no commands", f"{path}.{name}"
            )
