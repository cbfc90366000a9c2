"""Fields that are set beside others which leave them without effect: nothing is ignored silently."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from joshua.config.checks.blocks import Block
from joshua.config.checks.context import Context
from joshua.plan import Diagnostic
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2 as types
from joshua.schema.options_pb2 import WEIGHTS_NONE
from joshua.schema.rules import value_rule
from joshua.textproto.field_facts import FieldFacts


def check(context: Context) -> Iterator[Diagnostic]:
    """Notes fields without effect, and input devices that move nothing."""
    for block in context.blocks:
        rule = _RULES.get(type(block.message))
        if rule is not None:
            yield from rule(context, block)
        for facts in block.facts:
            if facts.overridden_by:
                yield from _overridden(context, block, facts)
            if facts.message_type is pb.JointControl.DESCRIPTOR:
                yield from _controls(context, block, facts)
    yield from _operation(context)


def _note(context: Context, block: Block, name: str, reason: str, remedy: str) -> Diagnostic:
    path = block.field_path(name)
    return context.note("field-unused", f"{name} has no effect: {reason}", path, remedy=remedy)


def _qos(context: Context, block: Block) -> Iterator[Diagnostic]:
    if block.message.history == pb.KEEP_ALL and block.message.depth > 0:
        yield _note(
            context, block, "depth", "KEEP_ALL keeps every message", "Remove depth, or set history: KEEP_LAST"
        )


def _overridden(context: Context, block: Block, facts: FieldFacts) -> Iterator[Diagnostic]:
    """A field whose place another takes."""
    other = facts.overridden_by
    if getattr(block.message, other) and context.is_set(block, facts.name):
        reason = facts.overridden_because
        yield _note(context, block, facts.name, reason, f"Remove {facts.name} or {other}")


def _mock_motor(context: Context, block: Block) -> Iterator[Diagnostic]:
    motion = block.message.motion
    if motion == pb.MOCK_MOTION_FILE and not block.message.motion_file:
        yield context.error(
            "required-missing",
            "MOCK_MOTION_FILE needs motion_file, the CSV file that is replayed",
            block.field_path("motion_file"),
            position=context.position(block.field_path("motion")),
            remedy='Add motion_file: "motions/wave.csv"',
        )
    needs = {
        "motion_file": pb.MOCK_MOTION_FILE,
        "motion_amplitude_rad": pb.MOCK_MOTION_SINE,
        "motion_frequency_hz": pb.MOCK_MOTION_SINE,
    }
    for name, needed in needs.items():
        if motion != needed and context.is_set(block, name):
            value = pb.MockMotion.Name(needed)
            yield _note(
                context, block, name, f"it belongs to motion: {value}", f"Remove it, or set motion: {value}"
            )


def _model(context: Context, block: Block) -> Iterator[Diagnostic]:
    name = "pretrained_model_name_or_path"
    model_type = block.message.model_type
    needs = value_rule(pb.ModelType.DESCRIPTOR, model_type).weights
    if needs == WEIGHTS_NONE and block.message.pretrained_model_name_or_path:
        yield _note(
            context,
            block,
            name,
            f"{pb.ModelType.Name(model_type)} has no weights",
            "Remove it, or choose another model_type",
        )


def _controls(context: Context, block: Block, facts: FieldFacts) -> Iterator[Diagnostic]:
    """Joints that a person moves with an input device."""
    owner = next(
        (entry for entry in context.graph.entries if block.path.startswith(f"{entry.owner_path}.")), None
    )
    sent = {publisher.data_type for publisher in owner.node.publishers} if owner else set()
    if getattr(block.message, facts.name):
        needed = facts.needs_published
        if needed and types.DataType.Value(needed) not in sent:
            remedy = f"Add publishers {{ data_type: {needed} … }} to the node, or remove {facts.name}"
            yield _note(context, block, facts.name, f"the node publishes no {needed}", remedy)
    elif sent != {types.JOY}:
        message = (
            f"{block.path.rpartition('.')[2]} has no controls, so nothing that a person does moves a joint"
        )
        remedy = f"Add {facts.sample()} for each joint"
        yield context.warning("controls-missing", message, block.path, remedy=remedy)


def _operation(context: Context) -> Iterator[Diagnostic]:
    """Fields of the data store that belong to one operation or mode."""
    block = next((item for item in context.blocks if item.path == "ai.data_store"), None)
    if block is None:
        return
    store = block.message
    mode = context.config.general.mode
    if store.operation and mode not in (pb.MODE_UNSPECIFIED, pb.MODE_DATA_STORE, pb.MODE_SIMULATION):
        yield _note(
            context,
            block,
            "operation",
            "it says what MODE_DATA_STORE does, and the mode is another",
            "Remove it, or set mode: MODE_DATA_STORE in general",
        )
    elif store.episodes and store.operation != pb.DATA_STORE_REPLAY:
        yield _note(
            context,
            block,
            "episodes",
            "it belongs to operation: DATA_STORE_REPLAY",
            "Remove it, or set operation: DATA_STORE_REPLAY",
        )


_RULES: dict[type[Any], Callable[[Context, Block], Iterator[Diagnostic]]] = {
    pb.QoSSettings: _qos,
    pb.MockMotorConfig: _mock_motor,
    pb.SingleModel: _model,
}
