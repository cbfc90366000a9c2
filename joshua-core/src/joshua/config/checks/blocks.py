"""Every block of a configuration with its field path, third-party blocks included."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from google.protobuf.message import DecodeError, Message

from joshua.textproto.field_facts import FieldFacts, field_facts

_ANY = "google.protobuf.Any"


class Block(NamedTuple):
    """One message of the configuration.

    Attributes:
        path: field path; "" for the whole configuration.
        message: the message itself; for an ``Any`` block the message inside it.
        facts: of its fields.
    """

    path: str
    message: Any
    facts: tuple[FieldFacts, ...]

    def has_presence(self, name: str) -> bool:
        """Whether a field of this block knows the difference between unset and default."""
        return next(facts.has_presence for facts in self.facts if facts.name == name)

    def field_path(self, name: str) -> str:
        """Path of a field of this block."""
        return f"{self.path}.{name}" if self.path else name


def all_blocks(config: Message) -> list[Block]:
    """Lists the configuration and every block inside it, outer blocks first, in the order of the schema."""
    found: list[Block] = []
    waiting = [Block("", config, field_facts(config.DESCRIPTOR))]
    while waiting:
        block = waiting.pop()
        found.append(block)
        waiting.extend(reversed(list(_inner(block))))
    return found


def _inner(block: Block) -> Iterator[Block]:
    for facts in block.facts:
        if not facts.is_message:
            continue
        path = block.field_path(facts.name)
        if facts.repeated:
            children = [(f"{path}[{i}]", item) for i, item in enumerate(getattr(block.message, facts.name))]
        elif block.message.HasField(facts.name):
            children = [(path, getattr(block.message, facts.name))]
        else:
            continue
        for child_path, child in children:
            message = unpacked(child) if facts.message_type.full_name == _ANY else child
            if message is not None:
                yield Block(child_path, message, field_facts(message.DESCRIPTOR))


def unpacked(block: Any) -> Message | None:
    """Returns the message inside an ``Any`` block, or None when its type is not registered."""
    from google.protobuf import descriptor_pool, message_factory

    name = block.type_url.rpartition("/")[2]
    try:
        descriptor = descriptor_pool.Default().FindMessageTypeByName(name)
        message: Message = message_factory.GetMessageClass(descriptor)()
        message.ParseFromString(block.value)
    except (KeyError, DecodeError):
        return None  # loading has reported the unknown type
    return message
