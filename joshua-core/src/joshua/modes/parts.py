"""What the checks of several modes ask of a file."""

from __future__ import annotations

from joshua.config.checks import Context
from joshua.config.checks.context import is_command
from joshua.config.topics import Endpoint, NodeEntry
from joshua.plan import Diagnostic, Position
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2 as types

COMMAND_TYPES = (types.JOINT_STATE, types.JOINT_TRAJECTORY)


def mode_name(context: Context) -> str:
    """Name of the file's mode, such as ``MODE_TEST``."""
    return pb.OperationMode.Name(context.config.general.mode)


def lacks(context: Context, code: str, what: str, path: str, *, remedy: str, **details: object) -> Diagnostic:
    """Makes the error that the mode needs something which the file does not have."""
    return context.error(
        code,
        f"{mode_name(context)} needs {what}",
        path,
        position=details.pop("position", None) or mode_position(context),
        remedy=remedy,
        **details,
    )


def mode_position(context: Context) -> Position | None:
    """Place of ``general.mode``: what the file lacks has no place of its own."""
    return context.position("general.mode")


def actions(context: Context) -> list[NodeEntry]:
    """The actuators of the file."""
    return [entry for entry in context.entries if isinstance(entry.owner, pb.SingleAction)]


def perceptions(context: Context) -> list[NodeEntry]:
    """The sensors and input devices of the file."""
    return [entry for entry in context.entries if isinstance(entry.owner, pb.SinglePerception)]


def models(context: Context) -> list[NodeEntry]:
    """The models of the file."""
    return [entry for entry in context.entries if is_model(entry)]


def is_model(entry: NodeEntry) -> bool:
    """Whether a node runs a model."""
    return isinstance(entry.owner, pb.SingleModel)


def commands(context: Context, entry: NodeEntry) -> list[Endpoint]:
    """Subscriptions by which an actuator takes commands."""
    return [item for item in context.of_entry(entry) if is_command(item)]


def command_sources(context: Context) -> dict[str, list[Endpoint]]:
    """Publishers that can command an actuator, by topic."""
    found: dict[str, list[Endpoint]] = {}
    for item in context.usable:
        if item.is_publisher and item.block.data_type in COMMAND_TYPES:
            found.setdefault(item.topic, []).append(item)
    return found
