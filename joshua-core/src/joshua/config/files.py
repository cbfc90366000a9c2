"""Reads a configuration file as text, or returns an error for whatever is at the path."""

from __future__ import annotations

import errno
import os
import re
import stat
from typing import NamedTuple

from joshua.textproto.diagnostics import Diagnostics
from joshua.textproto.limits import MAX_FILE_BYTES
from joshua.textproto.source import Source, Span

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
# From this many invalid bytes on, a file does not count as text.
_BINARY_FAULTS = 20
_SUFFIX = ".pbtxt"


class FileId(NamedTuple):
    """The identity of a file."""

    device: int
    inode: int


def file_id(path: str) -> FileId | None:
    """Return the identity of the file at a path; None if there is none."""
    try:
        found = os.stat(path)  # noqa: PTH116 (as below: a check of a correct file imports no pathlib)
    except (OSError, ValueError):
        return None
    return FileId(found.st_dev, found.st_ino)


def read_source(path: str, problems: Diagnostics, at: Span | None) -> Source | None:
    """Read a file.

    Args:
        path: as diagnostics show it, relative to the working directory.
        at: the include that names the file; None for the file of the command line.

    Returns:
        The text, with single invalid bytes repaired; None if there is no usable text.
    """
    data = read_bytes(path, problems, at)
    return None if data is None else decode_source(path, data, problems, at)


def read_bytes(path: str, problems: Diagnostics, at: Span | None) -> bytes | None:
    """Read the bytes of a file; None on failure. Arguments as for ``read_source``."""
    if not path:
        problems.error("file-missing", "The path of the configuration file is empty.", at, found='""')
        return None
    try:
        # Opening a pipe or a device could block or act on it, so its kind is checked first.
        kind = os.stat(path)  # noqa: PTH116
        if not _is_regular(path, kind.st_mode, problems, at):
            return None
        if kind.st_size > MAX_FILE_BYTES:
            _too_large(path, f"{kind.st_size} bytes", problems, at)
            return None
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as file:
            if not _is_regular(path, os.fstat(handle).st_mode, problems, at):
                return None
            return file.read(MAX_FILE_BYTES + 1)
    except (FileNotFoundError, NotADirectoryError):
        _missing(path, problems, at)
    except (OSError, ValueError) as fault:
        _unreadable(path, fault, problems, at)
    return None


def _is_regular(path: str, mode: int, problems: Diagnostics, at: Span | None) -> bool:
    if stat.S_ISREG(mode):
        return True
    from pathlib import Path

    kinds = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
    kinds |= {stat.S_IFCHR: "a device", stat.S_IFBLK: "a device"}
    kind = kinds.get(stat.S_IFMT(mode), "no regular file")
    inside = [str(Path(path, name)) for name in _configurations_in(path)] if stat.S_ISDIR(mode) else []
    message = f"{path} is {kind}, not a configuration file."
    problems.error("not-a-file", message, at, found=kind, allowed=inside)
    return False


def _missing(path: str, problems: Diagnostics, at: Span | None) -> None:
    from pathlib import Path

    from joshua.textproto.nearest import nearest

    where = Path(path)
    candidates = _configurations_in(str(where.parent))
    # The common suffix would make all names look similar.
    stems = {name.removesuffix(_SUFFIX): name for name in candidates}
    near = [stems[stem] for stem in nearest(where.stem, list(stems))]
    if f"{where.name}{_SUFFIX}" in candidates:
        near = [f"{where.name}{_SUFFIX}", *near]
    allowed = [str(where.parent / name) for name in dict.fromkeys(near)]
    code, message, field = "include-missing", f"There is no file {path} to include.", "include"
    remedy = f"Did you mean {allowed[0]}?" if allowed else ""
    if at is None:
        code, message, field = "file-missing", f"There is no file {path}.", ""
        remedy += " `joshua presets` lists files to start from." if remedy else ""
    problems.error(code, message, at, path=field, found=path, allowed=allowed, remedy=remedy)


def _unreadable(path: str, fault: Exception, problems: Diagnostics, at: Span | None) -> None:
    number = fault.errno if isinstance(fault, OSError) else None
    reason = os.strerror(number) if number else str(fault)
    shown = path.encode("utf-8", "backslashreplace").decode().replace("\0", "\\0")
    is_no_path = number in (errno.ENAMETOOLONG, errno.ELOOP)
    remedy = "Give the path of a configuration file." if is_no_path else ""
    problems.error("file-unreadable", f"{shown} cannot be read: {reason}.", at, found=reason, remedy=remedy)


def _too_large(path: str, size: str, problems: Diagnostics, at: Span | None) -> None:
    most = MAX_FILE_BYTES // 1024 // 1024
    message = f"{path} has {size}; a configuration may have at most {most} MiB."
    problems.error("file-too-large", message, at, found=size)


def _configurations_in(folder: str) -> list[str]:
    """List the names of the configuration files in a folder; none if it cannot be read."""
    try:
        with os.scandir(folder) as entries:
            return sorted(entry.name for entry in entries if entry.name.endswith(_SUFFIX))[:100]
    except OSError:
        return []


def decode_source(path: str, data: bytes, problems: Diagnostics, at: Span | None) -> Source | None:
    """Decode the bytes of a file. Arguments and result as for ``read_source``."""
    if len(data) > MAX_FILE_BYTES:
        _too_large(path, f"more than {MAX_FILE_BYTES} bytes", problems, at)
        return None
    if data.startswith(_UTF16_MARKS):
        message = f"{path} is UTF-16 text; configurations are UTF-8."
        problems.error("not-utf8", message, at, found="UTF-16", remedy="Save the file as UTF-8.")
        return None
    data = data.removeprefix(_BYTE_ORDER_MARK).replace(b"\r\n", b"\n")
    text = data.decode("utf-8", "surrogateescape")  # a byte that is not UTF-8 becomes one surrogate
    is_clean = "\0" not in text and (text.isascii() or not re.search("[\udc80-\udcff]", text))
    found = () if is_clean else re.finditer("[\0\udc80-\udcff]", text)
    faults = [(match.start(), ord(match[0])) for match in found]
    if len(faults) >= _BINARY_FAULTS:
        message = f"{path} is not a text file: many of its bytes are invalid in text."
        remedy = "Give the path of a configuration file."
        problems.error("not-utf8", message, at, found="binary data", remedy=remedy)
        return None
    source = Source(path, text if is_clean else re.sub("[\0\udc80-\udcff]", " ", text))
    problems.register(path)
    for offset, code in faults:
        place, byte = Span(source, offset, offset + 1), f"0x{code & 0xFF:02x}"
        if code:
            problems.error("not-utf8", f"The byte {byte} is not UTF-8 text.", place, found=byte)
        else:
            problems.error("nul-byte", "The text contains a NUL byte.", place, found="NUL")
    return source
