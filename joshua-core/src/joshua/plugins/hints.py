"""Which distribution provides which block, value and command, as the schema states beside each of them.

This serves messages only: what runs is decided by the registry, never by what is stated here.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple


class Stated(NamedTuple):
    """What the schema states of plugins.

    Attributes:
        blocks: rule of a block by the name of the field that holds it; messages: its descriptor likewise.
        enum_values, commands: distribution by enum value and by command of ``joshua``.
    """

    blocks: dict[str, Any]
    messages: dict[str, Any]
    enum_values: dict[str, str]
    commands: dict[str, str]

    def distributions(self) -> set[str]:
        """All distributions that are named."""
        blocks = {name for rule in self.blocks.values() for name in (rule.plugin, rule.emulator) if name}
        return blocks | set(self.enum_values.values()) | set(self.commands.values())


@cache
def stated() -> Stated:
    """Reads the schema from ``Config`` on."""
    from joshua.schema.config_pb2 import Config
    from joshua.schema.rules import block_rule, value_rule

    found = Stated({}, {}, {}, {})
    seen, waiting = set(), [Config.DESCRIPTOR]
    while waiting:
        for field in waiting.pop().fields:
            for value in field.enum_type.values if field.enum_type is not None else ():
                if plugin := value_rule(field.enum_type, value.number).plugin:
                    found.enum_values[value.name] = plugin
            message = field.message_type
            if message is None:
                continue
            found.messages.setdefault(field.name, message)
            rule = block_rule(message)
            if rule.plugin:
                found.blocks.setdefault(field.name, rule)
            for command in rule.commands:
                found.commands[command.name] = command.plugin or rule.plugin
            if message.full_name not in seen:
                seen.add(message.full_name)
                waiting.append(message)
    return found


def block_message(block: str) -> Any:
    """Descriptor of a block, by the field that holds it or by its message's full name; None if unknown."""
    from google.protobuf import descriptor_pool

    try:
        return stated().messages.get(block) or descriptor_pool.Default().FindMessageTypeByName(block)
    except KeyError:
        return None


def distribution_for(block: str, enum_value: str = "") -> str:
    """Names the published plugin for a block, else for an enum value; "" where none is known.

    The simulator of ``rl_config`` decides its trainer, so that an enum value of a backend goes first there.
    A block with a dot is a message of a third party, whose package nobody here knows.
    """
    by_value: str = stated().enum_values.get(enum_value, "")
    if enum_value.startswith("BACKEND_"):
        return by_value
    if block in stated().blocks:
        return str(stated().blocks[block].plugin)
    return "" if "." in block else by_value


def emulator_for(block: str) -> str:
    """Names the published plugin that emulates the device of a block; "" where none is known."""
    return str(stated().blocks[block].emulator) if block in stated().blocks else ""
