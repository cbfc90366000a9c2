"""Messages with arbitrary content, as a broken file may leave them: every check gets through."""

from __future__ import annotations

import random
from typing import Any

import pytest
from google.protobuf.descriptor import FieldDescriptor
from joshua.config import check
from joshua.config.checks.paths import check_paths
from joshua.config.diagnostics import render_json, render_text
from joshua.config.loading import LoadedConfig
from joshua.modes import check_mode
from joshua.schema import config_pb2 as pb
from joshua.schema.descriptors import is_repeated
from joshua.textproto.positions import Positions

TEXTS = (
    "",
    "arm",
    "/arm/joint_states",
    "~/x",
    "a b",
    "/",
    "//",
    "\0",
    "\x1b[2J",
    "機",
    "x" * 5000,
    "..",
    "~nobody/x",
    "tls/0.0.0.0:7447",
    "tcp/[::1]:1",
    "/dev/ttyACM0",
    "A",
    "MJPG",
)
FLOATS = (0.0, 1.0, -1.0, 50.0, 1e30, -1e30, float("nan"), float("inf"), float("-inf"), 1e-30)
INTEGERS = (0, 1, 2, 6, -1, 100, 4095, 2147483647, -2147483648)


def bare(config: pb.Config) -> LoadedConfig:
    """A configuration without places: as if nothing were known about its text."""
    return LoadedConfig("", config, Positions())


def fill(message: Any, chance: random.Random, depth: int = 0) -> None:
    for descriptor in message.DESCRIPTOR.fields:
        if chance.random() < 0.35:
            continue
        if descriptor.message_type is not None:
            if depth > 8:
                continue
            if is_repeated(descriptor):
                for _ in range(chance.randint(0, 3)):
                    fill(getattr(message, descriptor.name).add(), chance, depth + 1)
            else:
                inner = getattr(message, descriptor.name)
                inner.SetInParent()
                fill(inner, chance, depth + 1)
        elif is_repeated(descriptor):
            getattr(message, descriptor.name).extend(
                scalar(descriptor, chance) for _ in range(chance.randint(0, 4))
            )
        else:
            setattr(message, descriptor.name, scalar(descriptor, chance))


def scalar(descriptor: Any, chance: random.Random) -> Any:
    kind = descriptor.cpp_type
    if kind == FieldDescriptor.CPPTYPE_STRING:
        return b"\xff\x01" if descriptor.type == FieldDescriptor.TYPE_BYTES else chance.choice(TEXTS)
    if kind == FieldDescriptor.CPPTYPE_BOOL:
        return chance.random() < 0.5
    if kind == FieldDescriptor.CPPTYPE_ENUM:
        values = [value.number for value in descriptor.enum_type.values]
        return chance.choice([*values, 9999])
    if kind in (FieldDescriptor.CPPTYPE_FLOAT, FieldDescriptor.CPPTYPE_DOUBLE):
        return chance.choice(FLOATS)
    return chance.choice(INTEGERS)


@pytest.mark.parametrize("part", range(5))
def test_any_message_gets_through_every_check(part: int) -> None:
    for number in range(part * 200, (part + 1) * 200):
        config = pb.Config()
        fill(config, random.Random(number))
        loaded = bare(config)
        found = [*check(loaded), *check_mode(loaded), *check_paths(loaded, launch=number % 2 == 0)]
        render_text(found, loaded.sources).encode()
        render_json(found)
        for item in found:
            assert item.position is None


def test_an_empty_message_lacks_only_the_general_block() -> None:
    loaded = bare(pb.Config())
    assert [item.field_path for item in check(loaded)] == ["general"]
    assert check_mode(loaded) == []
    assert check_paths(loaded, launch=True) == []
