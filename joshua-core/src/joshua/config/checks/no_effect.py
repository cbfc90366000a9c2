"""Fields that are set beside others which leave them without effect: nothing is ignored silently."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from joshua.config.checks.blocks import Block
from joshua.config.checks.context import Context
from joshua.plan import Diagnostic
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2 as types


def check(context: Context) -> Iterator[Diagnostic]:
    """Notes fields without effect, and input devices that move nothing."""
    for block in context.blocks:
        rule = _RULES.get(type(block.message))
        if rule is not None:
            yield from rule(context, block)
    yield from _operation(context)


def _note(context: Context, block: Block, name: str, reason: str, remedy: str) -> Diagnostic:
    path = block.field_path(name)
    return context.note(
        "field-unused",
        f"{name} has no effect: {reason}",
        path,
        found=context.text_at(context.loaded.positions.value(path)),
        remedy=remedy,
    )


def _qos(context: Context, block: Block) -> Iterator[Diagnostic]:
    if block.message.history == pb.KEEP_ALL and block.message.depth > 0:
        yield _note(
            context,
            block,
            "depth",
            "KEEP_ALL keeps every message",
            "Remove depth, or set history: KEEP_LAST",
        )


def _camera(context: Context, block: Block) -> Iterator[Diagnostic]:
    if block.message.source and context.is_set(block, "device_id"):
        yield _note(
            context,
            block,
            "device_id",
            "source says where the pictures come from",
            "Remove device_id or source",
        )


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
    if block.message.model_type == pb.RANDOM_NOISE and block.message.pretrained_model_name_or_path:
        yield _note(
            context,
            block,
            name,
            "RANDOM_NOISE has no weights",
            "Remove it, or choose another model_type",
        )


def _input_device(context: Context, block: Block) -> Iterator[Diagnostic]:
    owner = next(
        (entry for entry in context.graph.entries if block.path.startswith(f"{entry.owner_path}.")), None
    )
    sent = {publisher.data_type for publisher in owner.node.publishers} if owner else set()
    if block.message.controls:
        if types.JOINT_STATE not in sent and isinstance(block.message, pb.GamepadConfig):
            remedy = "Add publishers { data_type: JOINT_STATE … } to the node, or remove controls"
            yield _note(context, block, "controls", "the node publishes no JOINT_STATE", remedy)
    elif sent != {types.JOY}:
        sample = next(facts for facts in block.facts if facts.name == "controls").sample()
        yield context.warning(
            "controls-missing",
            f"{block.path.rpartition('.')[2]} has no controls, so nothing that a person does moves a joint",
            block.path,
            position=context.block_position(block.path),
            remedy=f"Add {sample} for each joint",
        )


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
    pb.CameraConfig: _camera,
    pb.MockMotorConfig: _mock_motor,
    pb.SingleModel: _model,
    pb.GamepadConfig: _input_device,
    pb.KeyboardConfig: _input_device,
}
