"""Git LFS pointers: the short text files that stand in place of large files which were not fetched.

Source: https://github.com/git-lfs/git-lfs/blob/main/docs/spec.md
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

_FIRST_LINE = b"version https://git-lfs.github.com/spec/"

#: A pointer is shorter than this, by its specification.
_LARGEST_POINTER_B = 1024


def is_pointer_text(content: str | bytes) -> bool:
    """Return whether the content of a file is that of a Git LFS pointer."""
    start = content.encode(errors="replace") if isinstance(content, str) else content
    return start.startswith(_FIRST_LINE)


def is_lfs_pointer(path: Path) -> bool:
    """Return whether a file is a Git LFS pointer; False for a file that cannot be read."""
    try:
        if not path.is_file() or path.stat().st_size >= _LARGEST_POINTER_B:
            return False
        with path.open("rb") as file:
            return file.read(len(_FIRST_LINE)) == _FIRST_LINE
    except OSError:
        return False


def fetch_command(path: Path) -> str:
    """Return the command that fetches the file in place of a pointer, or all files of a folder.

    Outside of a clone, ``git lfs pull`` cannot work; the whole repository has to be cloned again.
    """
    folder = path.resolve() if path.is_dir() else path.parent.resolve()
    root = next((place for place in (folder, *folder.parents) if (place / ".git").exists()), None)
    if root is None:
        return "git lfs install, then clone the repository that it came from again"
    command = f"git -C {shlex.quote(str(root))} lfs pull"
    if path.resolve() == root:
        return command
    name = path.resolve().relative_to(root).as_posix()
    return f"{command} --include {shlex.quote(name)}"


def describe_pointer(path: Path) -> tuple[str, str] | None:
    """Return what is wrong with a file that is a Git LFS pointer, and the remedy; None for any other file."""
    if not is_lfs_pointer(path):
        return None
    message = f"{path} is a Git LFS pointer: the repository was cloned without its large files"
    return message, f"Run {fetch_command(path)}"


def describe_pointers(folder: Path, paths: Sequence[Path]) -> tuple[str, str] | None:
    """Return what is wrong with the files of a folder that are Git LFS pointers, and one remedy for all.

    Args:
        folder: that contains them; paths: of files, of which any may be a pointer.

    Returns:
        None if none of them is a pointer.
    """
    found = [path for path in paths if is_lfs_pointer(path)]
    if len(found) < 2:
        return describe_pointer(found[0]) if found else None
    message = (
        f"{len(found)} files of {folder} are Git LFS pointers, {found[0]} first: "
        "the repository was cloned without its large files"
    )
    return message, f"Run {fetch_command(folder)}"
