"""Names and paths from files, messages and remotes, checked before they reach the file system.

Every name that becomes a part of a path passes ``safe_name``. Every path that a description leads to passes
``inside``, for reading as for writing: no ``..``, no absolute path and no symlink leaves the folder. The
folder itself is the user's choice, and may be a symlink.

The checks protect from the content of a folder, not from a process that changes the folder meanwhile.
"""

from __future__ import annotations

import os
import re
import shutil
import stat
import unicodedata
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path, PurePath

#: Longest name in bytes. File systems allow 255; the rest is for suffixes.
LONGEST_NAME = 200

#: Longest part of a path in bytes.
_LONGEST_PART = 255

#: Characters of a name or path in a message.
_LONGEST_SHOWN = 200

#: Characters that are allowed in a name beside letters and digits.
_OTHERS = " _-.+=@,()#~"

#: Unicode categories of letters, digits and the marks that belong to letters.
_LETTERS = ("L", "M", "N")

#: Names that Windows opens as a device, whatever their suffix.
_DEVICES = {
    "con",
    "prn",
    "aux",
    "nul",
    *(f"{kind}{number}" for kind in ("com", "lpt") for number in range(10)),
}

_RULE = f"Allowed are letters, digits, spaces and {' '.join(_OTHERS.strip())}, a letter, digit or _ first"

_FIELD = re.compile(r"\{(?P<name>\w*)(?::0?(?P<width>\d{1,2})d)?\}|[{}]")


class UnsafePathError(OSError, ValueError):
    """A name or a path leads out of the folder that it belongs to.

    It is an ``OSError``, as for any path that cannot be opened, and a ``ValueError`` of the description.
    """


def safe_name(name: str, what: str = "the name") -> str:
    """Return a name that can be a part of a path on every file system.

    Args:
        name: to check; what: what it names, for the message.

    Raises:
        UnsafePathError: it contains a separator or another character that is not allowed, is too long, or is
            reserved.
    """
    fault = name_fault(name)
    if fault:
        raise UnsafePathError(f"{what} {shown(name)} cannot be a file name: {fault}")
    return name


def name_fault(name: str) -> str:
    """Return why a name cannot be a part of a path, and what is allowed; "" for a safe one."""
    if not name:
        return "it is empty"
    size = len(name.encode("utf-8", "surrogatepass"))
    if size > LONGEST_NAME:
        return f"it has {size} bytes. At most {LONGEST_NAME} are allowed"
    for character in name:
        if character not in _OTHERS and unicodedata.category(character)[0] not in _LETTERS:
            return f"it contains {_described(character)}. {_RULE}"
    composed = unicodedata.normalize("NFKC", name)
    if composed != name:
        return f"it has characters that look like others. Write it as {shown(composed)}"
    if name[0] != "_" and unicodedata.category(name[0])[0] not in "LN":
        return f"it begins with {_described(name[0])}. {_RULE}"
    if name[-1] in " .":
        return f"it ends with {_described(name[-1])}, which some file systems remove"
    if name.partition(".")[0].rstrip().casefold() in _DEVICES:
        return "Windows opens a device of that name. Choose another name"
    return ""


def check_distinct(names: Iterable[str], what: str = "the names") -> None:
    """Check that no two names are the same file where the case of letters does not count.

    Raises:
        UnsafePathError: two names differ only in that.
    """
    seen: dict[str, str] = {}
    for name in names:
        other = seen.setdefault(unicodedata.normalize("NFKC", name).casefold(), name)
        if other != name:
            raise UnsafePathError(
                f"{what} {shown(other)} and {shown(name)} are the same file on some disks: rename one of them"
            )


def filled(template: str, values: Mapping[str, int | str]) -> str:
    """Fill in a path template such as ``data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet``.

    Only names and widths of integers are allowed, unlike ``str.format``, which reads attributes and pads to
    any length.

    Raises:
        UnsafePathError: the template has another field.
    """

    def value(match: re.Match[str]) -> str:
        name, width = match["name"], match["width"]
        found = values.get(name) if name else None
        if found is None or (width and not isinstance(found, int)):
            allowed = ", ".join(f"{{{known}}}" for known in values)
            raise UnsafePathError(
                f"the path {shown(template)} has the field {match[0]!r}. Allowed: {allowed}, "
                "integers with a width such as :03d"
            )
        return f"{found:0{int(width)}d}" if width else str(found)

    return _FIELD.sub(value, template)


def inside(folder: Path, path: str | PurePath, what: str = "the path") -> Path:
    """Return a path below a folder, after the check that it stays there.

    Args:
        folder: that it belongs to.
        path: need not exist; a string is relative to the folder, and a ``Path`` may begin with the folder.
        what: what it is, for the message.

    Raises:
        UnsafePathError: it is absolute, contains ``..``, a NUL or a part that no file system can store, or a
            symlink on the way leads out of the folder or to itself.
    """
    joined = _joined(folder, path)
    try:
        parts = joined.relative_to(folder).parts
    except ValueError:
        raise UnsafePathError(f"{what} {shown(path)} is outside {folder}") from None
    for part in parts:
        if part == "..":
            raise UnsafePathError(f"{what} {shown(path)} is outside {folder}: it contains ..")
        if any(unicodedata.category(character) in ("Cc", "Cs") for character in part):
            raise UnsafePathError(f"{what} {shown(path)} contains a control character")
        if len(part.encode()) > _LONGEST_PART:
            raise UnsafePathError(f"{what} {shown(path)} has a part above {_LONGEST_PART} bytes")
    try:
        real, real_folder = joined.resolve(), folder.resolve()
    except (OSError, RuntimeError) as error:  # too long, or a symlink to itself
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise UnsafePathError(f"{what} {shown(path)} cannot be followed: {reason}") from error
    if not real.is_relative_to(real_folder):
        raise UnsafePathError(
            f"{what} {shown(joined)} is a symlink that leads outside {folder}, to {shown(real)}. "
            "Replace it by what it leads to, or remove it"
        )
    return joined


def name_inside(folder: Path, path: str | PurePath, what: str = "the path") -> Path:
    """Return a path below a folder that is to be renamed, replaced or removed as it is.

    Its last part may be a symlink to anywhere, because none of these operations follows it.

    Raises:
        UnsafePathError: as ``inside``, for the folder that contains it; or it is the folder itself.
    """
    joined = _joined(folder, path)
    if joined == folder or joined.name == "..":
        raise UnsafePathError(f"{what} {shown(path)} is not in {folder}")
    inside(folder, joined.parent, what)
    try:
        inside(joined.parent, joined.name, what)
    except UnsafePathError:
        if not joined.is_symlink():
            raise
    return joined


def file_inside(folder: Path, path: str | PurePath, what: str = "the file") -> Path:
    """Return the path of a file below a folder that is to be opened; it need not exist.

    Raises:
        UnsafePathError: as ``inside``, or it is a pipe, a device, a socket or a folder.
    """
    found = inside(folder, path, what)
    try:
        mode = found.stat().st_mode
    except FileNotFoundError:
        return found
    if not stat.S_ISREG(mode):
        kind = next(name for name, matches in _KINDS.items() if matches(mode))
        raise UnsafePathError(f"{what} {shown(found)} is {kind}, not a file")
    return found


def tree_inside(folder: Path, path: str | PurePath, what: str = "the folder") -> Path:
    """Return the path of a folder that is to be read or copied with all that it contains.

    Raises:
        UnsafePathError: as ``inside``, for the folder or for anything below it.
    """
    found = inside(folder, path, what)
    for place, folders, files in os.walk(found):
        for name in folders:
            inside(folder, Path(place) / name, what)
        for name in files:
            file_inside(folder, Path(place) / name, what)
    return found


def remove_tree(folder: Path, path: str | PurePath, what: str = "the folder") -> None:
    """Remove a folder below another one with all that it contains; symlinks in it are removed, not followed.

    Raises:
        UnsafePathError: as ``inside``; nothing is removed.
        OSError: removing fails.
    """
    shutil.rmtree(inside(folder, path, what))


def shown(name: object) -> str:
    """Return a name or path quoted for a message: on one line, without control characters, shortened."""
    text = str(name)
    if len(text) > _LONGEST_SHOWN:
        text = f"{text[: _LONGEST_SHOWN // 2]}...{text[-_LONGEST_SHOWN // 2 :]}"
    return repr(text)


def _joined(folder: Path, path: str | PurePath) -> Path:
    """Return a path below a folder, which may be relative to the working folder."""
    is_below = isinstance(path, PurePath) and path.is_relative_to(folder)
    return Path(path) if is_below else folder / path


_KINDS: dict[str, Callable[[int], bool]] = {
    "a folder": stat.S_ISDIR,
    "a pipe": stat.S_ISFIFO,
    "a socket": stat.S_ISSOCK,
    "a device": stat.S_ISCHR,
    "a disk": stat.S_ISBLK,
    "something else": lambda mode: True,
}


def _described(character: str) -> str:
    if character == " ":
        return "a space"
    if character.isascii() and character.isprintable():
        return repr(character)
    return f"the character U+{ord(character):04X}"
