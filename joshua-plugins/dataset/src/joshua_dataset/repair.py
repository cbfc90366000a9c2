"""Complete what a kill, a power cut or a full disk has left unfinished in a data set.

A repair removes nothing that was recorded: what is whole becomes an episode, and what cannot be mended is
moved aside. Only ``cut`` discards the unfinished episode.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from joshua.features import DatasetLayout, EpisodeError, FeatureSet

from joshua_dataset import changes, open_episode
from joshua_dataset.files import Files, aside_folder, cause, remedy_first
from joshua_dataset.formats import writer_of
from joshua_dataset.lock import PRIVATE, WriterLock
from joshua_dataset.mcap_writer import McapWriter
from joshua_dataset.metadata import INFO, OURS, check_layout
from joshua_dataset.open_episode import SUFFIXES
from joshua_dataset.pictures import ENCODERS
from joshua_dataset.reader import NUMBER_TYPES, Dataset, DatasetError
from joshua_dataset.writer import DatasetWriter


@dataclass(frozen=True)
class Repaired:
    """What a repair did.

    Attributes:
        text: in words; has_kept: an unfinished episode is part of the data set.
    """

    text: str
    has_kept: bool = False

    def __str__(self) -> str:
        return self.text


class _NotValid(Exception):
    """The journal of the unfinished episode does not say what it contains."""


def is_unfinished(folder: Path) -> bool:
    """Return whether a data set needs a repair. Raises EpisodeError if that cannot be read."""
    return changes.is_interrupted(folder) or open_episode.read_journal(folder) is not None


def repair(folder: Path, *, cut: bool = False, files: Files | None = None) -> str:
    """Repair a data set, see ``repaired``; return what was done, in words."""
    return repaired(folder, cut=cut, files=files).text


def repaired(folder: Path, *, cut: bool = False, files: Files | None = None) -> Repaired:
    """Repair a data set after a kill, a power cut or a full disk. Idempotent.

    Args:
        folder: of the data set; cut: discard the unfinished episode instead of completing it.
        files: file operations.

    Raises:
        EpisodeError: the folder is being written, is not a data set, or cannot be written; nothing that was
            recorded is removed.
    """
    files = files or Files()
    if not (folder / INFO).exists() and not is_unfinished(folder):
        raise EpisodeError(f"{folder} is not a data set: it has no {INFO}")
    lock = WriterLock(folder)
    try:
        lock.take()
        has_journal = open_episode.read_journal(folder) is not None
        has_recovered = changes.recover(folder, files)
        found = _finished(folder, lock, cut, files)
    except OSError as error:
        place = folder / PRIVATE / "open"
        what = f"The unfinished episode stays in {place}. " if place.exists() else ""
        raise EpisodeError(
            f"{folder} cannot be repaired: {cause(error)}. {what}"
            f"{remedy_first(error, f'run `joshua dataset repair {folder}` again')}"
        ) from error
    finally:
        lock.release()
    if not has_recovered:
        return found
    has_kept = found.has_kept or (has_journal and open_episode.read_journal(folder) is None)
    return Repaired(f"an interrupted change is completed; {found.text}", has_kept)


def _finished(folder: Path, lock: WriterLock, cut: bool, files: Files) -> Repaired:
    """Complete or discard the unfinished episode of a data set whose lock is held."""
    journal = open_episode.read_journal(folder)
    try:
        layout, writer_type = _layout(folder, journal)
    except _NotValid as error:
        if not cut:
            return _moved_aside(folder, journal, f"it has no valid journal ({error})", files)
        layout, writer_type = _layout(folder, None)
    writer = writer_type(layout, files)
    writer.take_up(lock)
    if journal is None:
        return Repaired(f"{folder} is complete: {writer.episodes} episodes")
    number = journal.get("episode_index", -1)
    if 0 <= number < writer.episodes:
        open_episode.remove(folder)
        return Repaired(f"episode {number} was complete; its leftovers are removed")
    if cut:
        open_episode.remove(folder)
        return Repaired(
            f"the unfinished episode {max(number, 0)} is discarded; {writer.episodes} episodes are complete"
        )
    if not journal:
        return _moved_aside(folder, journal, "it has no valid journal", files)
    task = str(journal.get("task", ""))
    if isinstance(writer, McapWriter):
        length_s = writer.complete(task, {})
        text = f"episode {number} is completed ({length_s:.1f} s)"
        nothing = "no message of it is whole"
    else:
        length = writer.keep_whole(task, {})
        length_s = length / layout.fps
        text = f"episode {number} is completed with {length} frames ({length_s:.1f} s)"
        nothing = "no frame of it has all its parts"
    if not length_s:
        return _moved_aside(folder, journal, nothing, files)
    if writer.aside is not None:
        text += f". The rest of it is damaged, and its files were moved to {writer.aside}"
    return Repaired(text, has_kept=True)


def _moved_aside(folder: Path, journal: dict[str, Any] | None, why: str, files: Files) -> Repaired:
    """Move the unfinished episode to where nothing is removed. Raises OSError."""
    number = (journal or {}).get("episode_index", -1)
    place = open_episode.open_folder(folder)
    aside = files.move_aside(place, aside_folder(folder), open_episode.aside_name(number))
    label = f"episode {number}" if number >= 0 else "episode"
    return Repaired(f"the unfinished {label} cannot be completed: {why}. Its files were moved to {aside}")


def _layout(folder: Path, journal: dict[str, Any] | None) -> tuple[DatasetLayout, type[DatasetWriter]]:
    """Return what the journal says about the data set; without one, nothing of it is needed.

    Raises:
        _NotValid: the journal does not describe a data set.
    """
    info = (journal or {}).get("info")
    if not isinstance(info, dict):
        kind = "lerobot"
        if (folder / INFO).exists():
            try:
                kind = Dataset.read(folder).format
            except DatasetError as error:
                raise EpisodeError(str(error)) from error
        return DatasetLayout(folder, "", 1, FeatureSet()), writer_of(kind)
    try:
        return _described(folder, info)
    except (KeyError, TypeError, ValueError, AttributeError, EpisodeError) as error:
        raise _NotValid(str(error)) from error


def _described(folder: Path, info: dict[str, Any]) -> tuple[DatasetLayout, type[DatasetWriter]]:
    """Return the layout in a journal.

    Raises:
        KeyError, TypeError, ValueError, AttributeError, EpisodeError: it is not valid.
    """
    ours, fps = info[OURS], info["fps"]
    if isinstance(fps, bool) or not isinstance(fps, int) or fps <= 0:
        raise ValueError(f"fps is {fps!r}")
    if ours["format"] != "mcap" and (ours["pictures"] not in SUFFIXES or ours["codec"] not in ENCODERS):
        raise ValueError(f"pictures are {ours['pictures']!r}, and the codec is {ours['codec']!r}")
    layout = DatasetLayout(
        folder=folder,
        robot_type=str(info["robot_type"]),
        fps=fps,
        features=FeatureSet.from_lerobot(info["features"]),
        codec=ours["codec"],
        pictures=ours["pictures"],
        identity={str(name): str(value) for name, value in ours["identity"].items()},
        counters=tuple(map(str, ours["counters"])),
    )
    for feature in layout.features.numbers:
        if feature.dtype not in NUMBER_TYPES:
            raise ValueError(f"{feature.key} has the dtype {feature.dtype!r}")
    if ours["format"] != "mcap":
        check_layout(layout, ours["format"])
    return layout, writer_of(ours["format"])
