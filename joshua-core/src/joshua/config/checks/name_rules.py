"""ROS 2 rules for names of topics, nodes, namespaces and frames, and the forms of UUIDs and ids."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator

from joshua.config.checks.context import Block, Context
from joshua.config.names import (
    NameFault,
    frame_fault,
    has_repeated_underscores,
    is_hidden,
    namespace_fault,
    node_name_fault,
    topic_fault,
)
from joshua.plan import Diagnostic
from joshua.schema import options_pb2 as rules
from joshua.textproto.field_facts import FieldFacts

_FAULTS: dict[int, tuple[str, Callable[[str], NameFault | None]]] = {
    rules.KIND_TOPIC: ("topic-name-invalid", topic_fault),
    rules.KIND_NODE_NAME: ("node-name-invalid", node_name_fault),
    rules.KIND_NAMESPACE: ("namespace-invalid", namespace_fault),
    rules.KIND_FRAME: ("frame-invalid", frame_fault),
}
# Patterns are not compiled here, because most files need none of them.
_HOST = r"[A-Za-z0-9]([A-Za-z0-9_.-]*[A-Za-z0-9])?"
_FILE_NAME = r"[A-Za-z0-9_][A-Za-z0-9_.-]*"
_VID_PID = r"[0-9A-Fa-f]{4}:[0-9A-Fa-f]{4}"
_UUID = r"[0-9A-Fa-f]{8}-([0-9A-Fa-f]{4}-){3}[0-9A-Fa-f]{12}"


def check(context: Context) -> Iterator[Diagnostic]:
    """Check every name against the rules of its kind."""
    for block in context.blocks:
        for facts in block.facts:
            if not facts.is_string:
                continue
            for path, value in _values(block, facts):
                if value:
                    yield from _name(context, facts, path, value)
    yield from _robot_id(context)


def _values(block: Block, facts: FieldFacts) -> list[tuple[str, str]]:
    path = block.field_path(facts.name)
    value = getattr(block.message, facts.name)
    if facts.repeated:
        return [(f"{path}[{index}]", item) for index, item in enumerate(value)]
    return [(path, value)]


def _name(context: Context, facts: FieldFacts, path: str, value: str) -> Iterator[Diagnostic]:
    if facts.kind in _FAULTS:
        code, find = _FAULTS[facts.kind]
        fault = find(value)
        if fault is not None:
            yield context.error(
                code,
                fault.rule,
                path,
                position=context.name_position(path, value, fault),
                allowed=(f'"{fault.suggestion}"',) if fault.suggestion else (),
                remedy=f"Rename it; {'tf2' if facts.kind == rules.KIND_FRAME else 'ROS 2'} refuses this name",
            )
        elif facts.kind == rules.KIND_TOPIC:
            yield from _unwise_topic(context, path, value)
    elif facts.kind == rules.KIND_UUID and not re.fullmatch(_UUID, value):
        message = f"{facts.name} must be a UUID of 36 characters: 8-4-4-4-12 hexadecimal digits"
        yield context.error("uuid-invalid", message, path, allowed=(facts.example,) if facts.example else ())
    elif facts.kind == rules.KIND_HOST and not re.fullmatch(_HOST, value):
        message = "A host name may contain only letters, digits, underscores, dots and hyphens"
        yield context.error("host-invalid", message, path)
    elif facts.name == "pixel_format" and not (len(value) == 4 and value.isascii() and value.isprintable()):
        yield context.error(
            "pixel-format-invalid",
            "A pixel format is a code of exactly four ASCII characters",
            path,
            allowed=('"MJPG"', '"YUYV"', '"RGB3"', '"H264"'),
        )
    elif facts.kind == rules.KIND_SERIAL_PORT and "/" not in value:
        yield from _port(context, path, value)
    elif facts.name == "vid_pid" and not re.fullmatch(_VID_PID, value):
        yield context.error(
            "usb-id-invalid",
            "vid_pid must be vendor and product id, four hexadecimal digits each, with a colon between",
            path,
            allowed=(facts.example,) if facts.example else (),
        )


def _port(context: Context, path: str, value: str) -> Iterator[Diagnostic]:
    """Check for ports that are not paths: a Windows port, or a device without its folder."""
    if not re.fullmatch(r"(?i)COM[0-9]+", value):
        allowed = (f'"/dev/{value}"',)
        message = f"{value} is no path of a serial port: it lacks the folder"
        yield context.error("serial-port-invalid", message, path, allowed=allowed)
    elif sys.platform != "win32":
        message = f"{value} is the name of a serial port on Windows; here a port is a path"
        yield context.warning(
            "serial-port-invalid", message, path, allowed=('"/dev/ttyACM0"', '"/dev/ttyUSB0"')
        )


def _unwise_topic(context: Context, path: str, value: str) -> Iterator[Diagnostic]:
    if has_repeated_underscores(value):
        at = value.index("__")
        yield context.warning(
            "topic-name-reserved",
            "The conventions of ROS 2 keep repeated underscores in topic names for its own use",
            path,
            position=context.name_position(path, value, NameFault("", at, 2, "")),
        )
    elif is_hidden(value):
        message = (
            "A topic with a part that starts with an underscore is hidden: "
            "ROS 2 tools list it only on request"
        )
        yield context.note("topic-name-hidden", message, path)


def _robot_id(context: Context) -> Iterator[Diagnostic]:
    """``general.id`` names a folder and a file, so it must not point elsewhere."""
    value = context.config.general.id
    if value and (not re.fullmatch(_FILE_NAME, value) or len(value) > 100):
        message = (
            "general.id names the run directory and the calibration file, so it may contain only letters, "
            "digits, underscores, dots and hyphens, must start with a letter or digit, "
            "and has at most 100 characters"
        )
        yield context.error("robot-id-invalid", message, "general.id", allowed=(f'"{_as_file_name(value)}"',))


def _as_file_name(value: str) -> str:
    cleaned = re.sub(r"[^A-Za-z0-9_.-]+", "-", value).strip("-.")[:100]
    return cleaned or "robot-001"
