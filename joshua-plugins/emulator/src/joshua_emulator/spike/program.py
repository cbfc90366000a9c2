"""Content of an emulated hub's user RAM, parsed and checked like the firmware does."""

from __future__ import annotations

import struct
from pathlib import Path

from joshua.api.files import name_fault

MPY_MAGIC, MPY_VERSION = ord("M"), 6
SMALL_INT_BITS = 31
MAIN = "__main__"
#: A foreign program on the hub.
OTHER_PROGRAM = Path(__file__).with_name("firmware") / "other_program.mpy"


class ProgramError(Exception):
    """The firmware cannot run the upload. The message is what it would print."""


def unpack(blob: bytes) -> dict[str, bytes]:
    """Modules of a multi-file program by name. Raises ProgramError."""
    modules: dict[str, bytes] = {}
    rest = blob
    while rest:
        if len(rest) < 4:
            raise ProgramError("ValueError: the program ends within a length")
        (length,) = struct.unpack_from("<I", rest)
        name, end, rest = rest[4:].partition(b"\0")
        if not end or length > len(rest):
            raise ProgramError("ValueError: the program ends within a module")
        modules[name.decode(errors="replace")] = check_mpy(rest[:length])
        rest = rest[length:]
    if MAIN not in modules:
        raise ProgramError(f"ImportError: no module named '{MAIN}'")
    return modules


def pack(code: bytes) -> bytes:
    """A program of one module."""
    return struct.pack("<I", len(code)) + MAIN.encode() + b"\0" + code


def check_mpy(code: bytes) -> bytes:
    """Return compiled code that a hub can load. Raises ProgramError."""
    if len(code) < 4 or code[0] != MPY_MAGIC or code[1] != MPY_VERSION or code[3] > SMALL_INT_BITS:
        raise ProgramError("ValueError: incompatible .mpy file")
    return code


def write_modules(modules: dict[str, bytes], folder: Path) -> str:
    """Write the modules as files. Return the name under which the main one is imported.

    Raises:
        ProgramError: a name leads elsewhere.
    """
    main = "uploaded_main"
    for name, code in modules.items():
        file_name = main if name == MAIN else name
        fault = name_fault(file_name)
        if fault:
            raise ProgramError(f"ValueError: the name of a module cannot be a file name: {fault}")
        (folder / f"{file_name}.mpy").write_bytes(code)
    return main
