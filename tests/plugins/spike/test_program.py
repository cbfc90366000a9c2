"""The hub program: what is shipped is what the source compiles to, and it keeps to the firmware's Python."""

from __future__ import annotations

import ast
import struct

import pytest
from joshua_spike.hub.build import compile_program
from joshua_spike.hub.program import COMPILED, SOURCE, load_program, pack, source_identity
from joshua_spike.pybricks import Capabilities, Command, stdin_commands, upload_commands

#: Methods that MicroPython leaves out where CPython compatibility is off, as it is on the hubs.
ABSENT = {"encode", "decode", "partition", "rpartition", "splitlines", "center", "removeprefix", "fromhex"}
MODULES = {"micropython", "uselect", "usys", "pybricks"}


def test_the_shipped_program_is_what_its_source_compiles_to() -> None:
    assert COMPILED.read_bytes() == compile_program(), "run python -m joshua_spike.hub.build"


def test_the_program_names_the_identity_of_its_source() -> None:
    program = load_program()
    assert program.identity == source_identity(SOURCE.read_text(encoding="utf-8"))
    assert program.identity.encode() in program.blob


def test_the_source_keeps_to_the_python_of_the_hub() -> None:
    tree = ast.parse(SOURCE.read_text(encoding="utf-8"))
    used = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    assert not used & ABSENT
    imported = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {str(name).partition(".")[0] for name in imported} <= MODULES
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.JoinedStr)]


def test_a_module_is_packed_with_length_and_name() -> None:
    assert pack(b"M\x06") == b"\x02\0\0\0__main__\0M\x06"


def test_an_upload_clears_the_size_first_and_starts_last() -> None:
    blob = bytes(range(256)) * 2
    commands = list(upload_commands(blob, 155))
    assert commands[0] == struct.pack("<BI", Command.WRITE_PROGRAM_META, 0)
    assert commands[-2] == struct.pack("<BI", Command.WRITE_PROGRAM_META, 512)
    assert commands[-1] == bytes([Command.START_PROGRAM])
    memory = bytearray(512)
    for chunk in commands[1:-2]:
        assert len(chunk) <= 155
        kind, offset = struct.unpack_from("<BI", chunk)
        assert kind == Command.WRITE_USER_RAM
        memory[offset : offset + len(chunk) - 5] = chunk[5:]
    assert memory == blob


def test_a_line_is_split_where_the_hub_takes_less_at_once() -> None:
    commands = list(stdin_commands(b"0123456789", 5))
    assert [command[:1] for command in commands] == [b"\x06"] * 3
    assert b"".join(command[1:] for command in commands) == b"0123456789"


def test_capabilities_of_older_and_newer_firmware_are_read() -> None:
    old = struct.pack("<HII", 155, 3, 258_048)
    assert Capabilities.parse(old) == Capabilities.parse(old + b"\x05") == Capabilities(155, 3, 258_048)
    with pytest.raises(ValueError, match="at least 10"):
        Capabilities.parse(b"\x9b\0")
