"""Fields without effect, input devices that move nothing, and safe states.

Nothing is ignored silently.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from joshua.config.checks.context import Block, Context
from joshua.config.checks.identity import title
from joshua.plan import Diagnostic
from joshua.plan.graph import NodeEntry
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2 as types
from joshua.schema.options_pb2 import WEIGHTS_NONE
from joshua.schema.rules import value_rule
from joshua.textproto.field_facts import FieldFacts, number_text

_RELEASES = (pb.RELEASE, pb.PARK_THEN_RELEASE)
_STORE_MODES = (pb.MODE_UNSPECIFIED, pb.MODE_DATA_STORE, pb.MODE_SIMULATION)


class _Unused(NamedTuple):
    """A field that has no effect if a test of its block and the file's mode is true."""

    field: str
    test: Callable[[Any, int], bool]
    reason: str
    remedy: str = ""


def _is_not_commanded(action: Any, mode: int) -> bool:
    return action.action_type == pb.ACTION_LEADER or not action.node.subscriptions


def _belongs(field: str, value: str, test: Callable[[Any, int], bool]) -> _Unused:
    return _Unused(field, test, f"it belongs to {value}", f"Remove it, or set {value}")


def _strategy(field: str, needed: int) -> _Unused:
    value = f"strategy: {pb.ExecutionStrategy.Name(needed)}"
    return _Unused(
        field,
        lambda block, _: block.strategy != needed,
        f"it belongs to {value}",
        f"Remove it, or set {value}",
    )


def _without_weights(field: str) -> _Unused:
    return _Unused(
        field,
        lambda block, _: value_rule(pb.ModelType.DESCRIPTOR, block.model_type).weights == WEIGHTS_NONE,
        "models of this type have no weights",
        "Remove it, or choose another model_type",
    )


_UNUSED: dict[type[Any], tuple[_Unused, ...]] = {
    pb.QoSSettings: (
        _Unused(
            "depth",
            lambda block, _: block.history == pb.KEEP_ALL and block.depth > 0,
            "KEEP_ALL keeps every message",
            "Remove depth, or set history: KEEP_LAST",
        ),
    ),
    pb.SingleModel: (
        _without_weights("pretrained_model_name_or_path"),
        _without_weights("compute"),
        _without_weights("task"),
    ),
    pb.ModelExecution: (
        _strategy("ensemble_coefficient", pb.TEMPORAL_ENSEMBLE),
        _strategy("execution_horizon", pb.REAL_TIME_CHUNKING),
        _strategy("max_guidance_weight", pb.REAL_TIME_CHUNKING),
        _strategy("guidance_schedule", pb.REAL_TIME_CHUNKING),
    ),
    pb.DataStore: (
        _Unused(
            "operation",
            lambda block, mode: bool(block.operation) and mode not in _STORE_MODES,
            "it says what MODE_DATA_STORE does, and the mode is another",
            "Remove it, or set mode: MODE_DATA_STORE in general",
        ),
        _belongs(
            "episodes",
            "operation: DATA_STORE_REPLAY",
            lambda block, mode: (
                block.operation != pb.DATA_STORE_REPLAY and not (block.operation and mode not in _STORE_MODES)
            ),
        ),
        _belongs("remote_url", "storage: STORAGE_CLOUD", lambda block, _: block.storage == pb.STORAGE_LOCAL),
        _Unused(
            "upload",
            lambda block, _: block.storage == pb.STORAGE_LOCAL or block.operation > pb.DATA_STORE_RECORD,
            "it says when a recording with storage: STORAGE_CLOUD is uploaded",
        ),
    ),
    pb.SingleAction: (
        _Unused("on_stale", _is_not_commanded, "the actuator follows no commands"),
        _Unused("on_stale_after_s", _is_not_commanded, "the actuator follows no commands"),
        _Unused(
            "on_stale_after_s",
            lambda block, mode: not _is_not_commanded(block, mode) and block.on_stale not in _RELEASES,
            "holding joints keep their position",
            "Remove it, or set on_stale: RELEASE or on_stale: PARK_THEN_RELEASE",
        ),
        _belongs(
            "park_pose_rad",
            "safe_state: PARK_THEN_RELEASE",
            lambda block, _: pb.PARK_THEN_RELEASE not in (block.safe_state, block.on_stale),
        ),
    ),
}


def check(context: Context) -> Iterator[Diagnostic]:
    """Note fields without effect, and find input devices that move nothing and unreachable safe states."""
    mode = context.config.general.mode
    for block in context.blocks:
        for row in _UNUSED.get(type(block.message), ()):
            if context.is_set(block, row.field) and row.test(block.message, mode):
                yield _note(context, block, row.field, row.reason, row.remedy)
        if isinstance(block.message, pb.SingleAction):
            yield from _safe_state(context, block.message, block.path)
        for facts in block.facts:
            other = facts.overridden_by
            if other and getattr(block.message, other) and context.is_set(block, facts.name):
                remedy = f"Remove {facts.name} or {other}"
                yield _note(context, block, facts.name, facts.overridden_because, remedy)
            if facts.needs_torque:
                yield from _without_torque(context, block, facts)
            if facts.only_with is not None:
                yield from _condition(context, block, facts)
            if facts.message_type is pb.JointControl.DESCRIPTOR:
                yield from _controls(context, block, facts)


def _owner(context: Context, block: Block) -> NodeEntry | None:
    """The node whose settings a block holds."""
    entries = context.graph.entries
    return next((entry for entry in entries if block.path.startswith(f"{entry.owner_path}.")), None)


def _without_torque(context: Context, block: Block, facts: FieldFacts) -> Iterator[Diagnostic]:
    """A field of a leader that concerns torque. Its default value says nothing, so it may stay."""
    is_default = number_text(getattr(block.message, facts.name)) == facts.default
    if is_default or not context.is_set(block, facts.name):
        return
    owner = _owner(context, block)
    if owner is not None and owner.leads:
        remedy = f"Remove it; it belongs to the follower of {title(owner)}"
        yield _note(context, block, facts.name, "a leader never has torque", remedy)


def _note(context: Context, block: Block, name: str, reason: str, remedy: str) -> Diagnostic:
    path = block.field_path(name)
    return context.note("field-unused", f"{name} has no effect: {reason}", path, remedy=remedy)


def _condition(context: Context, block: Block, facts: FieldFacts) -> Iterator[Diagnostic]:
    """A field that has an effect only with one value of an enum beside it."""
    needed, path = facts.only_with, block.field_path(facts.name)
    assert needed is not None
    enum = block.message.DESCRIPTOR.fields_by_name[needed.field].enum_type
    met = getattr(block.message, needed.field) == enum.values_by_name[needed.value].number
    text = f"{needed.field}: {needed.value}"
    if not met and context.is_set(block, facts.name):
        remedy = f"Remove it, or set {text}"
        yield _note(context, block, facts.name, f"it belongs to {text}", remedy)
    elif met and needed.required and not getattr(block.message, facts.name):
        place = context.position(block.field_path(needed.field))
        message, remedy = f"{text} requires {facts.name}", f"Add {facts.sample()}"
        yield context.error("required-missing", message, path, position=place, remedy=remedy)


def _controls(context: Context, block: Block, facts: FieldFacts) -> Iterator[Diagnostic]:
    """Joints that a person moves with an input device."""
    owner = _owner(context, block)
    sent = {publisher.data_type for publisher in owner.node.publishers} if owner else set()
    if getattr(block.message, facts.name):
        needed = facts.needs_published
        if needed and types.DataType.Value(needed) not in sent:
            remedy = f"Add publishers {{ data_type: {needed} … }} to the node, or remove {facts.name}"
            yield _note(context, block, facts.name, f"the node publishes no {needed}", remedy)
    elif sent != {types.JOY}:
        message = f"{block.path.rpartition('.')[2]} has no controls, so it cannot move a joint"
        remedy = f"Add {facts.sample()} for each joint"
        yield context.warning("controls-missing", message, block.path, remedy=remedy)


def _safe_state(context: Context, action: pb.SingleAction, path: str) -> Iterator[Diagnostic]:
    """Find leaders that would hold, and parking without a pose."""
    leads = action.action_type == pb.ACTION_LEADER
    if leads and action.safe_state not in (0, pb.RELEASE):
        verb = "park" if action.safe_state == pb.PARK_THEN_RELEASE else "hold"
        message = f"A leader never has torque, so it cannot {verb}"
        yield context.error("safe-state-unfit", message, f"{path}.safe_state", allowed=("RELEASE",))
    parks = ("safe_state", not leads), ("on_stale", not _is_not_commanded(action, 0))
    for field, counts in parks:
        if counts and getattr(action, field) == pb.PARK_THEN_RELEASE and not action.park_pose_rad:
            message = "PARK_THEN_RELEASE requires park_pose_rad, a pose in which the joints may lose torque"
            yield context.error("park-pose-missing", message, f"{path}.{field}", found="PARK_THEN_RELEASE")
