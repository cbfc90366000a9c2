"""Checks that types, settings blocks and links match."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from joshua.config.checks.context import Block, Context
from joshua.config.checks.device_table import block_of, device_block, fitting_blocks, fitting_types
from joshua.config.checks.identity import title
from joshua.plan import Diagnostic
from joshua.plan.graph import NodeEntry
from joshua.schema import comm_pb2
from joshua.schema import config_pb2 as pb
from joshua.schema.options_pb2 import WEIGHTS_NEEDED
from joshua.schema.rules import block_rule, value_rule
from joshua.textproto.field_facts import FieldFacts, field_facts


def check(context: Context) -> Iterator[Diagnostic]:
    """Find devices, models, stores and trainers whose type and settings do not match."""
    for entry in context.graph.entries:
        if isinstance(entry.owner, pb.SingleModel):
            yield from _model(context, entry)
        else:
            yield from _device(context, entry)
            yield from _simulated(context, entry)
    owners = {block.path: block for block in context.blocks}
    for block in context.blocks:
        if isinstance(block.message, comm_pb2.Comm):
            yield from _link(context, block, owners[block.path.rpartition(".")[0]])
    if context.config.ai.HasField("data_store"):
        yield from _data_store(context)
    if context.config.ai.HasField("training"):
        yield from _training(context)


def _device(context: Context, entry: NodeEntry) -> Iterator[Diagnostic]:
    owner = entry.owner
    is_action = isinstance(owner, pb.SingleAction)
    field = "action_type" if is_action else "perception_type"
    number = getattr(owner, field)
    enum = pb.ActionType if is_action else pb.PerceptionType
    if number not in enum.values():
        return
    type_name, chosen = enum.Name(number), number != 0
    name, _ = block_of(owner)
    blocks = fitting_blocks(owner)
    if not name:
        needed = _one_of(_samples(field_facts(owner.DESCRIPTOR), blocks) if len(blocks) == 1 else blocks)
        message = (
            f"{title(entry)} has no settings block, so nothing says which device it drives"
            if is_action
            else f"{title(entry)} has no settings block, so nothing says which device it reads"
        )
        remedy = f"Add {needed}" + (f", which {type_name} needs" if chosen and len(blocks) == 1 else "")
        yield context.error("block-missing", message, entry.owner_path, allowed=blocks, remedy=remedy)
    elif chosen and name not in blocks:
        path = f"{entry.owner_path}.{name}"
        others = fitting_types(owner, name)
        hint = f", or change {field} to {_one_of(others)}" if others else ""
        yield context.error(
            "block-unfit",
            f"{type_name} does not go with {name}",
            path,
            found=name,
            allowed=blocks,
            remedy=f"Write {_one_of(blocks)} in its place{hint}",
            related=context.see(f"{entry.owner_path}.{field}", field),
        )


def _one_of(names: tuple[str, ...]) -> str:
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _simulated(context: Context, entry: NodeEntry) -> Iterator[Diagnostic]:
    name, _, rule = device_block(entry.owner)
    if rule.simulated and not context.config.HasField("simulation"):
        path = f"{entry.owner_path}.{name}"
        message = f"{title(entry)} is part of a simulated robot, and the file has no simulation block"
        yield context.error("simulation-missing", message, path, found=name)


def _link(context: Context, block: Block, device: Block) -> Iterator[Diagnostic]:
    owner = device.path.rpartition(".")[2]
    needed = block_rule(device.message.DESCRIPTOR).link
    link = block.message.WhichOneof("interface")
    if link is None:
        allowed = (needed,) if needed else ("serial", "ble")
        message = "comm names no link to the device"
        remedy = "Add " + _one_of(_samples(block.facts, allowed))
        yield context.error("link-missing", message, block.path, allowed=allowed, remedy=remedy)
    elif needed and link != needed:
        path = f"{block.path}.{link}"
        message = f"{owner} needs a {needed} link; the device has no other"
        remedy = f"Write {_samples(block.facts, (needed,))[0]} in its place, or choose another device"
        yield context.error("link-unfit", message, path, found=link, allowed=(needed,), remedy=remedy)


def _samples(facts: tuple[FieldFacts, ...], names: tuple[str, ...]) -> tuple[str, ...]:
    by_name = {item.name: item for item in facts}
    return tuple(by_name[name].sample() for name in names)


def _model(context: Context, entry: NodeEntry) -> Iterator[Diagnostic]:
    model = entry.owner
    path = entry.owner_path
    if model.model_type == pb.MODEL_PLUGIN and not model.HasField("plugin_config"):
        yield _lacks_plugin(context, path, f"{path}.model_type", "MODEL_PLUGIN")
    type_name = pb.ModelType.DESCRIPTOR.values_by_number.get(model.model_type)
    chosen = type_name.name if type_name is not None else ""
    for field in model.DESCRIPTOR.fields:
        if field.message_type is None or not 100 <= field.number < 110:  # the settings blocks
            continue
        fits = block_rule(field.message_type).fits or ("MODEL_PLUGIN",)
        if model.model_type and chosen not in fits and _has(model, field.name):
            yield _unused(context, f"{path}.{field.name}", fits[0], f"{path}.model_type")
    weights = "pretrained_model_name_or_path"
    needs = value_rule(pb.ModelType.DESCRIPTOR, model.model_type).weights == WEIGHTS_NEEDED
    training = context.config.ai.training
    trained = training.environment == pb.ENV_REAL and training.method == pb.METHOD_IMITATION
    if needs and not model.pretrained_model_name_or_path and not trained:
        yield context.error(
            "weights-missing",
            f"{chosen} has no weights: an untrained model would move the robot at random",
            f"{path}.{weights}",
            allowed=('"lerobot/smolvla_base"', "a folder of trained weights"),
            remedy=f'Add {weights}: "lerobot/smolvla_base"',
        )


def _lacks_plugin(context: Context, owner_path: str, type_path: str, value: str) -> Diagnostic:
    return context.error(
        "block-missing",
        f"{value} needs plugin_config, which names the third party's message",
        f"{owner_path}.plugin_config",
        position=context.position(type_path),
        allowed=("plugin_config",),
        remedy="Add plugin_config { [type.example.org/package.Message] { ... } }",
    )


def _unused(context: Context, path: str, needed: str, type_path: str) -> Diagnostic:
    name = path.rpartition(".")[2]
    message = f"{name} has an effect only with {needed}"
    remedy = f"Remove {name}, or change {type_path.rpartition('.')[2]} to {needed}"
    related = context.see(type_path, type_path.rpartition(".")[2])
    return context.error("block-unfit", message, path, found=name, remedy=remedy, related=related)


def _data_store(context: Context) -> Iterator[Diagnostic]:
    store, path = context.config.ai.data_store, "ai.data_store"
    chosen = [name for name in ("format", "storage") if getattr(store, name) == pb.FORMAT_PLUGIN]  # of both
    if chosen and not store.HasField("plugin_config"):
        yield _lacks_plugin(context, path, f"{path}.{chosen[0]}", f"{chosen[0].upper()}_PLUGIN")
    elif store.HasField("plugin_config") and store.format and store.storage and not chosen:
        yield _unused(context, f"{path}.plugin_config", "FORMAT_PLUGIN", f"{path}.format")


#: The block with the parameters of each training method.
METHOD_BLOCKS = {
    pb.METHOD_RL: "rl_config",
    pb.METHOD_IMITATION: "imitation_config",
    pb.METHOD_EVAL: "eval_config",
    pb.METHOD_PLUGIN: "plugin_config",
}


def _training(context: Context) -> Iterator[Diagnostic]:
    training, path = context.config.ai.training, "ai.training"
    needed = METHOD_BLOCKS.get(training.method)
    if needed is None:
        return  # the rules of the fields report a missing method
    method = pb.TrainingMethod.Name(training.method)
    if not _has(training, needed):
        yield context.error(
            "block-missing",
            f"{method} needs {needed}, which holds its parameters",
            f"{path}.{needed}",
            position=context.position(f"{path}.method"),
            allowed=(needed,),
            remedy=f"Add {needed} {{ ... }} to training; "
            f"`joshua explain ai.training.{needed}` lists its fields",
        )
    for number, name in METHOD_BLOCKS.items():
        if name in (needed, "plugin_config") or not _has(training, name):
            continue
        message = (
            f"{name} has no effect: it belongs to {pb.TrainingMethod.Name(number)}, "
            f"and the method is {method}"
        )
        remedy = "Remove it, or change the method"
        yield context.note("block-unused", message, f"{path}.{name}", remedy=remedy)
    if training.environment == pb.ENV_SIMULATION and training.method == pb.METHOD_RL:
        yield from _backend(context, training)


def _backend(context: Context, training: pb.Training) -> Iterator[Diagnostic]:
    path = "ai.training"
    if training.simulator_backend == pb.BACKEND_UNSPECIFIED:
        yield context.error(
            "required-missing",
            "Training in simulation needs a simulator_backend",
            f"{path}.simulator_backend",
            position=context.position(f"{path}.environment"),
            allowed=("BACKEND_MUJOCO", "BACKEND_MJX", "BACKEND_ISAAC", "BACKEND_PLUGIN"),
            remedy="Add simulator_backend: BACKEND_MUJOCO",
        )
    elif training.simulator_backend == pb.BACKEND_PLUGIN and not training.HasField("plugin_config"):
        yield _lacks_plugin(context, path, f"{path}.simulator_backend", "BACKEND_PLUGIN")


def _has(message: Any, name: str) -> bool:
    return bool(message.HasField(name))
