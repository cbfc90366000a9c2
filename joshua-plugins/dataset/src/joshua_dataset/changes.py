"""Changes of a data set as transactions: after a kill, a power cut or an error, all of a change or nothing.

A change is prepared in the private folder of the data set. When all its files are safe on the disk, a journal
of the moves decides it: from then on the change is completed, by this process or by ``recover`` in the next
one. The moves are renames, which need no space.

Every change happens under the lock of the data set.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import shutil
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any

import pyarrow as pa
from joshua.api.files import file_inside, free_name, inside, name_inside, tree_inside
from joshua.features import EpisodeError
from joshua.tools import parse_json

from joshua_dataset.files import Files, aside_folder, cause, remedy_first
from joshua_dataset.lock import PRIVATE, WriterLock
from joshua_dataset.metadata import INFO, is_own
from joshua_dataset.open_episode import open_folder
from joshua_dataset.output import write_json, write_lines, write_table

JOURNAL = "journal.json"

_PLACE = Path(PRIVATE) / "change"


class _Kind(Enum):
    """When a move is made."""

    CLEAR = "clear"
    """First: make room for what is put."""
    PUT = "put"
    """Then: move a file into place."""
    LEAVE = "leave"
    """At the end: take away what the change was made of."""


_Move = tuple[_Kind, Path, Path]


def change_folder(folder: Path) -> Path:
    """Return the private folder of a data set's change. Raises UnsafePathError for one elsewhere."""
    return inside(folder, _PLACE, "the folder of the change")


def is_interrupted(folder: Path) -> bool:
    """Return whether a decided change of a data set is not complete."""
    return os.path.lexists(folder / _PLACE / JOURNAL)


class Change:
    """One change of a data set; readers see nothing of it before ``commit``.

    Args:
        folder: of the data set, whose lock is held; files: file operations.

    Attributes:
        place: private folder of the change.
        is_decided: the change is going to be complete, whatever happens.

    Raises:
        UnsafePathError: a path leads out of the data set. The methods raise it, too.
    """

    def __init__(self, folder: Path, files: Files) -> None:
        self._folder, self._files = folder, files
        self.place = folder / _PLACE
        self.is_decided = False
        self._has_begun = False
        self._staged: list[Path] = []
        self._moves: list[_Move] = []
        self._last: _Move | None = None

    def begin(self) -> None:
        """Make the private folder, without what an undecided change left there. Raises OSError."""
        change_folder(self._folder)
        if is_interrupted(self._folder):
            raise OSError(errno.EBUSY, "a change is not complete", str(self.place))
        if os.path.lexists(self.place):
            shutil.rmtree(self.place)
        self._files.make_folder(self.place)
        self._has_begun = True

    def table(self, path: Path, table: pa.Table) -> None:
        """Write a table in the format that the suffix names: ``.parquet``, ``.csv`` or ``.jsonl``.

        Raises:
            OSError, pyarrow.ArrowException: writing fails.
        """
        write_table(self._fresh(path), table)

    def lines(self, path: Path, records: Iterable[Mapping[str, Any]]) -> None:
        """Write a line of JSON for each record. Raises OSError; ValueError for a number that JSON has not."""
        write_lines(self._fresh(path), records)

    def json(self, path: Path, value: Any, *, last: bool = False) -> None:
        """Write a value as JSON.

        Args:
            last: the file is moved into place when all others are there.

        Raises:
            OSError: writing fails. ValueError: JSON has no such number.
        """
        write_json(self._fresh(path, last=last), value)

    def put(self, source: Path, path: Path, *, last: bool = False) -> None:
        """Move a complete file or folder of the private folder into place; an older one is replaced."""
        move = (_Kind.PUT, name_inside(self._folder, source), name_inside(self._folder, path))
        if last:
            self._last = move
        else:
            self._moves.append(move)

    @property
    def made(self) -> Path:
        """Folder in which a whole data set can be made, for ``put_made``."""
        return self.place / "made"

    def put_made(self, *, without: Collection[str] = ()) -> None:
        """Move the data set in ``made`` into place.

        Args:
            without: files that are in place already, by their path in the data set.
        """
        for path in own_files(self.made):
            name = path.relative_to(self.made)
            if name.as_posix() not in without:
                self.put(path, self._folder / name, last=name == INFO)

    def clear_made(self) -> None:
        """Remove the data set in ``made``, which is not put into place."""
        shutil.rmtree(self.made)

    def retire_all(self, aside: Path | None = None, *, without: Collection[str] = ()) -> None:
        """Remove the data set, and no file of others in its folder, before files are put into place.

        Args:
            aside: folder in that of what was moved aside, to which the files are moved; None to remove them.
            without: files that stay, by their path in the data set.
        """
        for path in sorted(
            own_files(self._folder), key=lambda path: path != self._folder / INFO
        ):  # it counts the others
            name = path.relative_to(self._folder)
            if name.as_posix() in without:
                continue
            if aside is None:
                self.retire(path)
            else:
                self._moves.append((_Kind.CLEAR, name_inside(self._folder, path), aside / name))

    def retire(self, path: Path) -> None:
        """Remove a file or folder of the data set, before files are put into place."""
        self._moves.append((_Kind.CLEAR, name_inside(self._folder, path), self._old()))

    def clear(self, path: Path) -> None:
        """Move aside what has the name of a file that is put, although nothing counts it."""
        if os.path.lexists(name_inside(self._folder, path)):
            target = free_name(aside_folder(self._folder), f"uncounted-{len(self._moves)}-{path.name}")
            self._moves.append((_Kind.CLEAR, path, target))

    def drop(self, path: Path) -> None:
        """Remove a folder of the private folder after files of it were put into place."""
        self._moves.append((_Kind.LEAVE, name_inside(self._folder, path), self._old()))

    def move_aside(self, path: Path, name: str) -> Path:
        """Move a folder to where nothing is removed, as ``drop``; return its place."""
        target = free_name(aside_folder(self._folder), name)
        self._moves.append((_Kind.LEAVE, name_inside(self._folder, path), target))
        return target

    def commit(self) -> None:
        """Decide the change and complete it. After an error, call it again if the change is decided.

        Raises:
            OSError: if ``is_decided``, ``commit`` or ``recover`` completes the change later.
        """
        if not self.is_decided:
            self._make_safe()
            rows = [
                [kind.value, *(path.relative_to(self._folder).as_posix() for path in paths)]
                for kind, *paths in self._all
            ]
            self._files.write(self.place / JOURNAL, json.dumps({"moves": rows}).encode())
            self.is_decided = True
        _complete(self._folder, self._all, self._files)

    def discard(self) -> None:
        """Remove what was prepared; a decided change stays. Files of ``put`` stay where they are."""
        if self._has_begun and not self.is_decided:
            with contextlib.suppress(OSError):  # the next change removes it
                shutil.rmtree(self.place)

    @property
    def _all(self) -> list[_Move]:
        return [*self._moves, *([self._last] if self._last is not None else [])]

    def _old(self) -> Path:
        return self.place / "old" / f"{len(self._moves):06d}"

    def _make_safe(self) -> None:
        """Bring everything that the journal names to the disk."""
        sources = [source for kind, source, _ in self._all if kind is _Kind.PUT]
        for source in sources:
            if source.is_dir():
                tree_inside(self._folder, source, "the folder")
            else:
                file_inside(self._folder, source)
            for path in (source, *source.rglob("*")) if source.is_dir() else (source,):
                if path.is_dir():
                    self._files.sync_folder(path)
                else:
                    self._files.sync(path)
        for folder in sorted({source.parent for source in sources}):
            self._files.sync_folder(folder)
        for folder in sorted({target.parent for *_, target in self._all}):
            self._files.make_folder(folder)

    def _fresh(self, path: Path, *, last: bool = False) -> Path:
        folder = self.place / "new"
        self._files.make_folder(folder)
        fresh = folder / f"{len(self._staged):06d}{path.suffix}"
        self._staged.append(fresh)
        self.put(fresh, path, last=last)
        return fresh


@contextlib.contextmanager
def changing(folder: Path, files: Files | None = None) -> Iterator[Change]:
    """Lock a data set for one change, which is discarded unless it is committed.

    Args:
        folder: of the data set; created if it does not exist.

    Raises:
        EpisodeError: another process writes the data set, it has an unfinished episode, or the disk refuses
            the change.
    """
    files = files or Files()
    lock = WriterLock(folder)
    change = Change(folder, files)
    is_new = not folder.exists()
    try:
        files.make_folder(folder)
        lock.take()
        recover(folder, files)
        if open_folder(folder).exists():
            raise EpisodeError(
                f"{folder} has an unfinished episode. Run `joshua dataset repair {folder}` first"
            )
        change.begin()
        yield change
    except OSError as error:
        raise _refused(folder, error, is_decided=change.is_decided) from error
    finally:
        if lock.is_held:
            change.discard()
        lock.release()
        if is_new:
            with contextlib.suppress(OSError):  # it is the data set by now, or was never made
                folder.rmdir()


def _refused(folder: Path, error: OSError, *, is_decided: bool) -> EpisodeError:
    if is_decided:
        state, then = "The change is not complete", f"run `joshua dataset repair {folder}` to complete it"
    else:
        state, then = "Nothing was changed", "run the command again"
    return EpisodeError(f"{folder} cannot be written: {cause(error)}. {state}. {remedy_first(error, then)}")


def aside_name(command: str) -> str:
    """Return the name of the folder of the files as they were before a command."""
    return f"before-{command}-{time.strftime('%Y%m%d-%H%M%S')}"


def own_files(folder: Path) -> list[Path]:
    """Return the files of a data set, and the folders of episodes, by name; files of others are left out."""
    found = []
    for place, folders, names in os.walk(folder):
        here = Path(place).relative_to(folder)
        whole = [name for name in folders if is_own((here / name).as_posix())]
        folders[:] = [name for name in folders if name not in whole and not name.startswith(".")]
        files = [name for name in names if is_own((here / name).as_posix())]
        found += [folder / here / name for name in (*whole, *files)]
    return sorted(found)


def files_of(folder: Path) -> list[Path]:
    """Return the files of a data set, by name; folders of episodes are taken apart."""
    found: list[Path] = []
    for path in own_files(folder):
        found += [path] if path.is_file() else sorted(inner for inner in path.rglob("*") if inner.is_file())
    return found


def recover(folder: Path, files: Files | None = None) -> bool:
    """Complete a decided change that was interrupted; return whether there was one.

    What an undecided or a complete change has left is removed: it only takes space.

    Args:
        folder: of the data set, whose lock is held.

    Raises:
        OSError: it cannot be completed yet. EpisodeError: its journal is not one of this program.
    """
    files = files or Files()
    place = change_folder(folder)
    try:
        text = file_inside(folder, place / JOURNAL, "the journal of the change").read_bytes()
    except FileNotFoundError:
        if os.path.lexists(place):
            shutil.rmtree(place)
        return False
    try:
        moves = [_move_of(folder, row) for row in parse_json(text)["moves"]]
    except (ValueError, KeyError, TypeError) as error:
        aside = files.move_aside(place, aside_folder(folder), "change")
        raise EpisodeError(
            f"{folder} has a change that cannot be completed, because its journal is not valid ({error}). "
            f"It was moved to {aside}. Run `joshua dataset check {folder}`"
        ) from error
    _complete(folder, moves, files)
    return True


def _move_of(folder: Path, row: Any) -> _Move:
    """Return a move from its journal. Raises ValueError for a path outside the data set."""
    kind, *names = row
    source, target = (name_inside(folder, str(name)) for name in names)
    return _Kind(kind), source, target


def _complete(folder: Path, moves: Sequence[_Move], files: Files) -> None:
    """Make the moves that are not made yet, in an order in which a cut leaves each recoverable."""
    put = [move for move in moves if move[0] is _Kind.PUT]
    steps = (
        [move for move in moves if move[0] is _Kind.CLEAR],
        put[:-1],
        put[-1:],
        [move for move in moves if move[0] is _Kind.LEAVE],
    )
    for step in steps:
        for move in step:
            _make(move, files)
        for parent in sorted({path.parent for _, *paths in step for path in paths}):
            if parent.is_dir():
                files.sync_folder(parent)
    place = change_folder(folder)
    (place / JOURNAL).unlink()
    files.sync_folder(place)
    shutil.rmtree(place, ignore_errors=True)  # what is left only takes space, until the next change


def _make(move: _Move, files: Files) -> None:
    kind, source, target = move
    # a target that exists shows that the source is what took its place
    is_made = kind is not _Kind.PUT and os.path.lexists(target)
    if not is_made and os.path.lexists(source):
        files.replace(source, target)
