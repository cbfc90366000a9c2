"""Takes the comments out of a proto file that is compiled with its source information."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from google.protobuf.descriptor_pb2 import DescriptorProto, EnumDescriptorProto, FileDescriptorProto

# Field numbers of descriptor.proto, which the paths of source locations are made of.
_FILE_MESSAGES, _FILE_ENUMS, _FILE_EXTENSIONS, _FILE_SYNTAX = 4, 5, 7, 12
_MESSAGE_FIELDS, _MESSAGE_NESTED, _MESSAGE_ENUMS, _MESSAGE_ONEOFS = 2, 3, 4, 8
_ENUM_VALUES = 2

_Path = tuple[int, ...]


def comment_table(file: FileDescriptorProto) -> dict[str, str]:
    """Returns the comments of a file by full name; the key "" holds the one at its head."""
    names = dict(_names(file))
    table: dict[str, str] = {}
    for location in file.source_code_info.location:
        name = names.get(tuple(location.path))
        if name is None:
            continue
        text = location.leading_comments or location.trailing_comments
        if not text and name == "" and location.leading_detached_comments:
            text = location.leading_detached_comments[0]
        if text.strip():
            table.setdefault(name, _reflow(text))
    return dict(sorted(table.items()))


def comment_json(file: FileDescriptorProto) -> str:
    """Returns the table as the JSON text that is kept beside the compiled module."""
    return json.dumps(comment_table(file), ensure_ascii=False, indent=1) + "\n"


def _names(file: FileDescriptorProto) -> Iterator[tuple[_Path, str]]:
    package = f"{file.package}." if file.package else ""
    yield (_FILE_SYNTAX,), ""
    for index, message in enumerate(file.message_type):
        yield from _message_names(message, (_FILE_MESSAGES, index), package)
    for index, enum in enumerate(file.enum_type):
        yield from _enum_names(enum, (_FILE_ENUMS, index), package)
    for index, extension in enumerate(file.extension):
        yield (_FILE_EXTENSIONS, index), f"{package}{extension.name}"


def _message_names(message: DescriptorProto, path: _Path, scope: str) -> Iterator[tuple[_Path, str]]:
    name = f"{scope}{message.name}"
    yield path, name
    for index, field in enumerate(message.field):
        yield (*path, _MESSAGE_FIELDS, index), f"{name}.{field.name}"
    for index, oneof in enumerate(message.oneof_decl):
        yield (*path, _MESSAGE_ONEOFS, index), f"{name}.{oneof.name}"
    for index, nested in enumerate(message.nested_type):
        yield from _message_names(nested, (*path, _MESSAGE_NESTED, index), f"{name}.")
    for index, enum in enumerate(message.enum_type):
        yield from _enum_names(enum, (*path, _MESSAGE_ENUMS, index), f"{name}.")


def _enum_names(enum: EnumDescriptorProto, path: _Path, scope: str) -> Iterator[tuple[_Path, str]]:
    name = f"{scope}{enum.name}"
    yield path, name
    for index, value in enumerate(enum.value):
        yield (*path, _ENUM_VALUES, index), f"{name}.{value.name}"


def _reflow(text: str) -> str:
    """Joins the lines of a comment into paragraphs, which stay apart by an empty line."""
    paragraphs: list[list[str]] = [[]]
    for line in text.strip().split("\n"):
        if line.strip():
            paragraphs[-1].append(line.strip())
        elif paragraphs[-1]:
            paragraphs.append([])
    return "\n\n".join(" ".join(lines) for lines in paragraphs if lines)


def read_descriptor_set(data: bytes, names: Sequence[str]) -> list[FileDescriptorProto]:
    """Returns the files of the given names out of a serialised FileDescriptorSet."""
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    found = {file.name: file for file in FileDescriptorSet.FromString(data).file}
    return [found[name] for name in names]
