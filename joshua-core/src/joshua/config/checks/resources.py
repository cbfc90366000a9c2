"""Checks that serial ports, Bluetooth devices, cameras and motor ids are used once."""

from __future__ import annotations

import itertools
import posixpath
from collections.abc import Iterator
from typing import NamedTuple

from google.protobuf.message import Message

from joshua.config.checks.context import Block, Context
from joshua.config.checks.identity import title
from joshua.plan import Diagnostic
from joshua.plan.graph import NodeEntry
from joshua.schema import options_pb2 as rules
from joshua.textproto.field_facts import FieldFacts, field_facts


class _Kind(NamedTuple):
    code: str
    message: str
    remedy: str


_EXCLUSIVE: dict[int, _Kind] = {
    rules.KIND_SERIAL_PORT: _Kind(
        "serial-port-shared",
        "{a} and {b} use the same serial port; only one node can open a serial port",
        "Give each device the port of its own adapter; `joshua find-port` lists them",
    ),
    rules.KIND_BLE_DEVICE: _Kind(
        "ble-device-shared",
        "{a} and {b} use the same Bluetooth device; it accepts one connection",
        "Rename one of the hubs, or let one node drive all its ports",
    ),
    rules.KIND_CAMERA_INDEX: _Kind(
        "camera-shared",
        "{a} and {b} use the same camera; only one node can open a camera",
        "Give each camera its own device_id or source; `joshua find-cameras` lists them",
    ),
}


class _Use(NamedTuple):
    entry: NodeEntry
    path: str


def check(context: Context) -> Iterator[Diagnostic]:
    """Find devices that two nodes of one machine would open, and ids that two motors of a bus share."""
    yield from _devices(context)
    for block in context.blocks:
        yield from _motor_ids(context, block)


def _devices(context: Context) -> Iterator[Diagnostic]:
    owners = {entry.owner_path: entry for entry in context.graph.entries}
    first: dict[tuple[int, str], dict[str, _Use]] = {}
    for block in context.blocks:
        entry = owners.get(".".join(block.path.split(".")[:2]))
        if entry is None:
            continue
        for facts in block.facts:
            if facts.kind not in _EXCLUSIVE or facts.repeated:
                continue
            identity, path = _identity(context, block, facts)
            if not identity:
                continue
            uses = first.setdefault((facts.kind, identity), {})
            clash = _clash(uses, entry.node.host)
            uses.setdefault(entry.node.host, _Use(entry, path))
            if clash is None:
                continue
            kind = _EXCLUSIVE[facts.kind]
            yield context.error(
                kind.code,
                kind.message.format(a=title(clash.entry), b=title(entry)),
                path,
                found=context.found(path) or f"{identity}, the default",
                remedy=kind.remedy,
                related=context.see(clash.path, f"{title(clash.entry)} uses it"),
            )


def _identity(context: Context, block: Block, facts: FieldFacts) -> tuple[str, str]:
    """The identity of a device and the path of its field; "" if it has none."""
    path = block.field_path(facts.name)
    value = getattr(block.message, facts.name)
    if facts.overridden_by and (other := getattr(block.message, facts.overridden_by)):
        deciding = next(item for item in block.facts if item.name == facts.overridden_by)
        return deciding.named_by(other)[1], block.field_path(deciding.name)
    if facts.kind == rules.KIND_CAMERA_INDEX:
        return (str(value) if value >= 0 else ""), path
    if facts.kind == rules.KIND_SERIAL_PORT:
        for name in ("serial_number", "vid_pid"):  # if given, the identity of the adapter decides
            identity = getattr(block.message, name, "")
            if identity:
                return f"{name} {identity.lower()}", block.field_path(name)
        return (posixpath.normpath(value) if value else ""), path
    return value, path


def _clash(uses: dict[str, _Use], host: str) -> _Use | None:
    """The first use of a device on the same machine.

    The same name on another machine is another device. A node without a host runs on every machine.
    """
    if not host:
        return next(iter(uses.values()), None)
    return uses.get(host) or uses.get("")


def _motor_ids(context: Context, block: Block) -> Iterator[Diagnostic]:
    for facts in block.facts:
        path = block.field_path(facts.name)
        values = getattr(block.message, facts.name)
        if facts.repeated and facts.kind == rules.KIND_MOTOR_ID:
            places = [(f"{path}[{index}]", value) for index, value in enumerate(values)]
        elif facts.repeated and facts.is_message:
            places = [
                (f"{path}[{index}].{name}", getattr(item, name))
                for index, item in enumerate(values)
                for name in _motor_id_fields(item)
            ]
        else:
            continue
        yield from _duplicates(context, places)


def _motor_id_fields(message: Message) -> list[str]:
    return [
        facts.name
        for facts in field_facts(message.DESCRIPTOR)
        if facts.kind == rules.KIND_MOTOR_ID and not facts.repeated
    ]


def _duplicates(context: Context, places: list[tuple[str, int]]) -> Iterator[Diagnostic]:
    taken = {value for _, value in places}
    free = (number for number in range(1, 254) if number not in taken)
    first: dict[int, str] = {}
    for path, value in places:
        if not context.is_known(path, value):
            continue
        other = first.setdefault(value, path)
        if other == path:
            continue
        yield context.error(
            "duplicate-motor-id",
            f"Motor id {value} appears twice on one bus; each motor must have its own id",
            path,
            allowed=tuple(f"{number} (a free id)" for number in itertools.islice(free, 1)),
            related=context.see(other, "first use of this id"),
        )
