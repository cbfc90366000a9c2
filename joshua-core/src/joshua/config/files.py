"""Reads a configuration file into text; whatever stands at the path, the answer is a text or an error."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from joshua.textproto.diagnostics import Diagnostics, Span
from joshua.textproto.limits import MAX_FILE_BYTES
from joshua.textproto.source import Source

if TYPE_CHECKING:
    from collections.abc import Sequence

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
# From this many faults on, a file is not a text with a slip but something else.
_BINARY_FAULTS = 20
_SUFFIX = ".pbtxt"


class FileId(NamedTuple):
    """What makes two paths the same file."""

    device: int
    inode: int


def file_id(path: str) -> FileId | None:
    """Returns the identity of the file at a path; None where there is none."""
    try:
        found = Path(path).stat()
    except (OSError, ValueError):
        return None
    return FileId(found.st_dev, found.st_ino)


def read_source(path: str, problems: Diagnostics, at: Span | None) -> Source | None:
    """Reads a file.

    Args:
        path: as diagnostics show it, relative to the working directory.
        at: the include that asks for the file; None for the file of the command line.

    Returns:
        The text, repaired where single bytes are wrong; None where there is no text to go on with.
    """
    data = read_bytes(path, problems, at)
    return None if data is None else decode_source(path, data, problems, at)


def read_bytes(path: str, problems: Diagnostics, at: Span | None) -> bytes | None:
    """Reads the bytes of a file; the arguments are those of ``read_source``, None where there are none."""
    if not path:
        problems.error("file-missing", "The path of the configuration file is empty.", at, found='""')
        return None
    try:
        # Opening a pipe or a device could block or act on it, so the kind is asked before.
        kind = Path(path).stat()
        if not _is_regular(path, kind.st_mode, problems, at):
            return None
        if kind.st_size > MAX_FILE_BYTES:
            _too_large(path, f"{kind.st_size} bytes", problems, at)
            return None
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as file:
            if not _is_regular(path, os.fstat(handle).st_mode, problems, at):
                return None
            data = file.read(MAX_FILE_BYTES + 1)
    except (FileNotFoundError, NotADirectoryError):
        _missing(path, problems, at)
        return None
    except (OSError, ValueError) as fault:
        _unreadable(path, fault, problems, at)
        return None
    return data


def _is_regular(path: str, mode: int, problems: Diagnostics, at: Span | None) -> bool:
    if stat.S_ISREG(mode):
        return True
    kinds = (
        (stat.S_ISDIR, "a folder"),
        (stat.S_ISFIFO, "a pipe"),
        (stat.S_ISSOCK, "a socket"),
        (stat.S_ISCHR, "a device"),
        (stat.S_ISBLK, "a device"),
    )
    kind = next((name for test, name in kinds if test(mode)), "no regular file")
    inside = _configurations_in(path) if stat.S_ISDIR(mode) else []
    problems.error(
        "not-a-file",
        f"{path} is {kind}, not a configuration file.",
        at,
        found=kind,
        allowed=[str(Path(path, name)) for name in inside],
    )
    return False


def _missing(path: str, problems: Diagnostics, at: Span | None) -> None:
    from joshua.textproto.nearest import nearest

    where = Path(path)
    candidates = _configurations_in(str(where.parent))
    # What all names end with would make each of them look like every other.
    stems = {name.removesuffix(_SUFFIX): name for name in candidates}
    near = [stems[stem] for stem in nearest(where.stem, list(stems))]
    if f"{where.name}{_SUFFIX}" in candidates:
        near = [f"{where.name}{_SUFFIX}", *near]
    allowed = [str(where.parent / name) for name in dict.fromkeys(near)]
    remedy = f"Did you mean {allowed[0]}?" if allowed else ""
    if at is None:
        remedy += " `joshua presets` lists files to start from." if remedy else ""
        problems.error(
            "file-missing", f"There is no file {path}.", None, found=path, allowed=allowed, remedy=remedy
        )
    else:
        problems.error(
            "include-missing",
            f"There is no file {path} to include.",
            at,
            path="include",
            found=path,
            allowed=allowed,
            remedy=remedy,
        )


def _unreadable(path: str, fault: Exception, problems: Diagnostics, at: Span | None) -> None:
    reason = os.strerror(fault.errno) if isinstance(fault, OSError) and fault.errno else str(fault)
    shown = path.encode("utf-8", "backslashreplace").decode().replace("\0", "\\0")
    remedy = ""
    if isinstance(fault, OSError) and fault.errno in (errno.ENAMETOOLONG, errno.ELOOP):
        remedy = "Give the path of a configuration file."
    problems.error("file-unreadable", f"{shown} cannot be read: {reason}.", at, found=reason, remedy=remedy)


def _too_large(path: str, size: str, problems: Diagnostics, at: Span | None) -> None:
    most = MAX_FILE_BYTES // 1024 // 1024
    problems.error(
        "file-too-large",
        f"{path} has {size}; at most {most} MiB are read as a configuration.",
        at,
        found=size,
    )


def _configurations_in(folder: str) -> list[str]:
    """Lists the names of the configuration files in a folder; none where it cannot be read."""
    try:
        with os.scandir(folder) as entries:
            return sorted(entry.name for entry in entries if entry.name.endswith(_SUFFIX))[:100]
    except OSError:
        return []


def decode_source(path: str, data: bytes, problems: Diagnostics, at: Span | None) -> Source | None:
    """Turns the bytes of a file into text; the arguments and the result are those of ``read_source``."""
    if len(data) > MAX_FILE_BYTES:
        _too_large(path, f"more than {MAX_FILE_BYTES} bytes", problems, at)
        return None
    if data.startswith(_UTF16_MARKS):
        problems.error(
            "not-utf8",
            f"{path} is UTF-16 text; configurations are UTF-8.",
            at,
            found="UTF-16",
            remedy="Save the file as UTF-8.",
        )
        return None
    data = data.removeprefix(_BYTE_ORDER_MARK).replace(b"\r\n", b"\n")
    faults: Sequence[tuple[int, int]] = ()
    try:
        text = data.decode()
    except UnicodeDecodeError:
        text, faults = _decode_with_faults(data)
    nul = _all_of("\0", text)
    if len(faults) + len(nul) >= _BINARY_FAULTS:
        problems.error(
            "not-utf8",
            f"{path} is no text file: it holds many bytes that no text holds.",
            at,
            found="binary data",
            remedy="Give the path of a configuration file.",
        )
        return None
    source = Source(path, text.replace("\0", " "))
    problems.register(path)
    for offset, byte in faults:
        problems.error(
            "not-utf8",
            f"The byte 0x{byte:02x} is not UTF-8 text.",
            Span(source, offset, offset + 1),
            found=f"0x{byte:02x}",
        )
    for offset in nul:
        problems.error("nul-byte", "A NUL byte stands here.", Span(source, offset, offset + 1), found="NUL")
    return source


def _decode_with_faults(data: bytes) -> tuple[str, list[tuple[int, int]]]:
    """Decodes what is UTF-8; a byte that is not becomes white space, with its offset and value."""
    pieces: list[str] = []
    faults: list[tuple[int, int]] = []
    length = 0
    at = 0
    while at < len(data) and len(faults) < _BINARY_FAULTS:
        try:
            pieces.append(data[at:].decode())
            break
        except UnicodeDecodeError as fault:
            piece = data[at : at + fault.start].decode()
            length += len(piece)
            faults.append((length, data[at + fault.start]))
            pieces += (piece, " ")
            length += 1
            at += fault.start + 1
    return "".join(pieces), faults


def _all_of(sign: str, text: str) -> list[int]:
    """Finds the first offsets of a sign, up to the number that makes a file binary."""
    found: list[int] = []
    at = text.find(sign)
    while at != -1 and len(found) < _BINARY_FAULTS:
        found.append(at)
        at = text.find(sign, at + 1)
    return found
