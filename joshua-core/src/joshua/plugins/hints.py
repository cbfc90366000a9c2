"""The distributions that provide blocks, values and commands, as stated in the schema.

For messages only. The registry decides what runs.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple


class Stated(NamedTuple):
    """Statements of the schema about plugins.

    Attributes:
        blocks: rule of a block by the name of its field; messages: its descriptor, likewise.
        enum_values, commands: distribution by enum value and by command of ``joshua``.
    """

    blocks: dict[str, Any]
    messages: dict[str, Any]
    enum_values: dict[str, str]
    commands: dict[str, str]

    def distributions(self) -> set[str]:
        """All named distributions."""
        blocks = {name for rule in self.blocks.values() for name in (rule.plugin, rule.emulator) if name}
        return blocks | set(self.enum_values.values()) | set(self.commands.values())


@cache
def stated() -> Stated:
    """Read the schema, starting at ``Config``."""
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
    """Descriptor of a block, by its field or by its message's full name; None if unknown."""
    from google.protobuf import descriptor_pool

    try:
        return stated().messages.get(block) or descriptor_pool.Default().FindMessageTypeByName(block)
    except KeyError:
        return None


def distribution_for(block: str, enum_value: str = "") -> str:
    """Return the published plugin for a block, else for an enum value; "" if none is known.

    The simulator of ``rl_config`` decides its trainer, so the enum value of a backend has priority there. A
    block with a dot is a message of a third party, whose package is unknown.
    """
    by_value: str = stated().enum_values.get(enum_value, "")
    if enum_value.startswith("BACKEND_"):
        return by_value
    if block in stated().blocks:
        return str(stated().blocks[block].plugin)
    return "" if "." in block else by_value


def emulator_for(block: str) -> str:
    """Return the published plugin that emulates the device of a block; "" if none is known."""
    return str(stated().blocks[block].emulator) if block in stated().blocks else ""
