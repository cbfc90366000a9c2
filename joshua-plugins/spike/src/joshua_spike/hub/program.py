"""The hub program as uploaded: identity, compiled form, and the blob that the firmware runs."""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass
from pathlib import Path

SOURCE = Path(__file__).with_name("joshua_hub.py")
COMPILED = SOURCE.with_suffix(".mpy")
HASH_PLACEHOLDER = "@HASH@"
SMALL_INT_BITS = 31  # of the hubs' 32-bit microcontrollers


@dataclass(frozen=True)
class HubProgram:
    """A program that can be uploaded.

    Attributes:
        identity: eight hexadecimal digits that the running program reports on request.
        blob: content of the hub's user RAM.
    """

    identity: str
    blob: bytes


def load_program() -> HubProgram:
    """Return the program of this release. Raises OSError if the installation is incomplete."""
    return HubProgram(source_identity(SOURCE.read_text(encoding="utf-8")), pack(COMPILED.read_bytes()))


def source_identity(source: str) -> str:
    """Return the identity of a program from its source, in which the identity is still empty."""
    return hashlib.sha256(source.encode()).hexdigest()[:8]


def pack(mpy: bytes, module: str = "__main__") -> bytes:
    """Return modules in the firmware's multi-file format: length, name and code of each."""
    return struct.pack("<I", len(mpy)) + module.encode() + b"\0" + mpy
