"""Paths of input files, relative to the folder of the file that contains them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

from google.protobuf.message import Message

from joshua.schema import options_pb2 as rules
from joshua.textproto.field_facts import FieldFacts, field_facts
from joshua.textproto.positions import Positions

_Block = TypeVar("_Block", bound=Message)


def with_absolute_paths(block: _Block, block_path: str, positions: Positions, source: str) -> _Block:
    """Make the paths of input files and interpreters absolute, for drivers that run in another folder.

    Args:
        block: a configuration block.
        block_path: its field path, such as ``robot.perceptions[0].camera_config``.
        positions: of the loaded configuration.
        source: the configuration file, for values outside a file, such as those of ``--set``.

    Returns:
        The block itself if it has no relative path, else a changed copy.
    """
    changed = dict(_absolute(block, block_path, positions, source))
    if not changed:
        return block
    copy = type(block)()
    copy.CopyFrom(block)
    for name, path in changed.items():
        setattr(copy, name, path)
    return copy


def folder_of(positions: Positions, path: str, source: str) -> Path:
    """The folder of the file that contains a field; that of the configuration for values outside a file."""
    position = positions.value(path)
    is_in_file = position is not None and Path(position.file).is_file()
    return Path(position.file if position is not None and is_in_file else source).absolute().parent


def _absolute(
    block: Message, block_path: str, positions: Positions, source: str
) -> Iterator[tuple[str, str]]:
    for facts in field_facts(block.DESCRIPTOR):
        if not facts.is_string or facts.repeated:
            continue
        value: Any = getattr(block, facts.name)
        if not value or not _is_file(facts, value):
            continue
        expanded = Path(os.path.expanduser(value))  # noqa: PTH111 - an unknown user stays as written
        if expanded.is_absolute():
            absolute = expanded
        else:
            folder = folder_of(positions, f"{block_path}.{facts.name}", source)
            absolute = Path(os.path.normpath(folder / expanded))
        if str(absolute) != value:
            yield facts.name, str(absolute)


def _is_file(facts: FieldFacts, value: str) -> bool:
    if facts.kind == rules.KIND_SOURCE:
        return facts.named_by(value)[0] in (rules.NAMES_FILE, rules.NAMES_FILES)
    return facts.kind in (rules.KIND_INPUT_FILE, rules.KIND_INTERPRETER)
