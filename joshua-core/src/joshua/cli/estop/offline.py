"""Releases the actuators of a file that does not run: an arm holds its position after a run, too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from joshua.guardian.latch import EstopReport

if TYPE_CHECKING:
    from joshua.plan import NodeSpec, Plan

#: Time for one device; it is nobody else's now.
TIMEOUT_S = 2.0


def actuators(plan: Plan) -> list[NodeSpec]:
    """The nodes that have joints."""
    from joshua.plan import NodeKind

    return [spec for spec in plan.nodes if spec.kind is NodeKind.ACTUATOR]


def release(specs: Sequence[NodeSpec], latch: str) -> list[EstopReport]:
    """Releases actuators one after the other, and reads back what that has done."""
    return [_release(spec, latch) for spec in specs]


def _release(spec: NodeSpec, latch: str) -> EstopReport:
    try:
        result = _act(spec)
    except Exception as error:  # noqa: BLE001 (a plugin's code; the others must be reached, too)
        result = {"complete": False, "detail": str(error) or type(error).__name__}
    joints = {str(joint): str(state) for joint, state in dict(result.get("joints", {})).items()}
    complete = bool(result.get("complete"))
    verified = complete and bool(result.get("verified", True))
    detail = str(result.get("detail", ""))
    return EstopReport(latch, spec.full_name, "command", complete, verified, joints, detail)


def _act(spec: NodeSpec) -> dict[str, Any]:
    from joshua.devices.actuator import Actuator
    from joshua.devices.context import ActuatorContext
    from joshua.guardian.main import load_action
    from joshua.node.implementation import load_implementation
    from joshua.plan import ActuatorFacts

    facts = spec.facts_as(ActuatorFacts)
    implementation, settings = load_implementation(spec, Actuator)
    actuator: Actuator = implementation(settings, ActuatorContext(facts))
    action = facts.estop_action
    if action:
        return load_action(action)(actuator.safe_stop_request("RELEASE", timeout_s=TIMEOUT_S).to_values())
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
