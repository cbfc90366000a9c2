"""Complete or discard the episode that a killed writer left unfinished."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import av
from joshua.api.files import UnsafePathError, file_inside, inside, remove_tree
from joshua.features import DatasetLayout, EpisodeError, FeatureSet

from joshua_dataset import open_episode
from joshua_dataset.formats import writer_of
from joshua_dataset.mcap_writer import McapWriter
from joshua_dataset.metadata import INFO, OURS, check_layout, pictures_of, place
from joshua_dataset.open_episode import SUFFIXES, columns_of, pictures_path
from joshua_dataset.pictures import ENCODERS, ERRORS, PICTURE_STRIDE
from joshua_dataset.reader import NUMBER_TYPES, Dataset, DatasetError, picture_of
from joshua_dataset.statistics import PictureStatistics, Statistics
from joshua_dataset.writer import DatasetWriter

#: Names of files that a killed change of a data set leaves; files of other names are not JOSHUA's.
_STAGED = (
    *("data/chunk-*/file-*.new", "meta/episodes/chunk-*/file-*.new"),
    *("meta/info.new", "meta/stats.new", "meta/tasks.new", "schema.new"),
)


def repair(folder: Path, *, cut: bool = False) -> str:
    """Repair a data set after a kill or a power cut. Idempotent.

    Args:
        folder: of the data set; cut: discard the unfinished episode instead of completing it.

    Returns:
        What was done, in one sentence.

    Raises:
        EpisodeError: the folder is being written, is not a data set, or cannot be written.
    """
    try:
        journal = open_episode.read_journal(folder)
    except UnsafePathError as error:
        raise EpisodeError(f"{folder} cannot be repaired: {error}") from error
    if not (folder / INFO).exists() and journal is None:
        raise EpisodeError(f"{folder} is not a data set: it has no {INFO}")
    layout, writer_type = _layout(folder, journal, cut=cut)
    writer = writer_type(layout)
    try:
        writer.take_up()
        for pattern in _STAGED:
            for path in folder.glob(pattern):
                inside(folder, path).unlink()
        return _repair(writer, journal, cut=cut)
    except (OSError, DatasetError) as error:
        reason = getattr(error, "strerror", None) or error
        raise EpisodeError(f"{folder} cannot be repaired: {reason}") from error
    finally:
        writer.close()


def _layout(
    folder: Path, journal: dict[str, Any] | None, *, cut: bool
) -> tuple[DatasetLayout, type[DatasetWriter]]:
    """Return what the journal says about the data set; without one, nothing of it is needed."""
    info = (journal or {}).get("info")
    if not isinstance(info, dict):
        kind = "lerobot"
        with contextlib.suppress(DatasetError):  # the writer says what is wrong
            kind = Dataset.read(folder).format
        return DatasetLayout(folder, "", 1, FeatureSet()), writer_of(kind)
    try:
        return _described(folder, info)
    except (KeyError, TypeError, ValueError, AttributeError, EpisodeError) as error:
        if cut:
            return _layout(folder, None, cut=cut)
        raise EpisodeError(
            f"{open_episode.open_folder(folder)} has a journal that is not valid ({error}). "
            f"Run `joshua dataset repair --cut {folder}` to discard that episode"
        ) from error


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


def _repair(writer: DatasetWriter, journal: dict[str, Any] | None, *, cut: bool) -> str:
    layout = writer.layout
    folder = layout.folder
    if journal is None:
        return f"{folder} is complete: {writer.episodes} episodes"
    number = journal.get("episode_index", -1)
    if number < writer.episodes and number >= 0:
        open_episode.remove(folder)
        return f"episode {number} was complete; its leftovers are removed"
    if isinstance(writer, McapWriter) and not cut:
        length_s = writer.complete(journal)
        if not length_s:
            return f"no message of the unfinished episode {number} is on the disk; it is discarded"
        return f"episode {number} is completed ({length_s:.1f} s)"
    rows = open_episode.rows_of(folder)
    if cut or number < 0 or rows is None:
        for path in _placed(writer, number).values():
            if path.is_dir():
                remove_tree(folder, path)
            else:
                path.unlink(missing_ok=True)
        open_episode.remove(folder)
        return (
            f"the unfinished episode {max(number, 0)} is discarded; {writer.episodes} episodes are complete"
        )
    pictures: dict[str, Statistics] = {}
    length = len(rows)
    placed = _placed(writer, number)
    for feature in layout.features.pictures:
        count, pictures[feature.key] = _pictures(layout, feature.key, placed.get(feature.key))
        length = min(length, count)
    if not length:
        open_episode.remove(folder)
        return f"no frame of the unfinished episode {number} has all its parts; it is discarded"
    columns = {name: values[:length] for name, values in columns_of(rows).items()}
    writer.keep(columns, pictures, str(journal.get("task", "")), {})
    return f"episode {number} is completed with {length} frames ({length / layout.fps:.1f} s)"


def _placed(writer: DatasetWriter, number: int) -> dict[str, Path]:
    """Return the pictures, by feature, that an interrupted commit has put in place; no episode has them."""
    layout = writer.layout
    if number != writer.episodes:
        return {}
    used: set[Path] = set()
    if (layout.folder / INFO).exists():
        for episode in Dataset.read(layout.folder).episode_list():
            used.update(where.path for where in episode.pictures.values())
    found = {
        feature.key: inside(layout.folder, pictures_of(layout, feature.key).format(**place(number)))
        for feature in layout.features.pictures
    }
    return {key: path for key, path in found.items() if path.exists() and path not in used}


def _pictures(layout: DatasetLayout, key: str, placed: Path | None) -> tuple[int, Statistics]:
    """Complete the pictures of the unfinished episode; return their number and statistics."""
    path = pictures_path(layout, key)
    if placed is not None and not path.exists():
        placed.replace(path)
    found, count = PictureStatistics(), 0
    height, width, _ = layout.features[key].shape
    try:
        if path.is_dir():
            for file in sorted(path.iterdir()):
                file_inside(layout.folder, file, "the picture")
                try:
                    picture = picture_of(file.read_bytes(), file, height, width)
                except (DatasetError, *ERRORS):
                    file.unlink()  # the last one, truncated
                    continue
                if count % PICTURE_STRIDE == 0:
                    found.add(picture)
                count += 1
        elif path.exists():
            file_inside(layout.folder, path, "the video")
            count = _remuxed(path, inside(layout.folder, path.with_suffix(".whole")), found)
    except UnsafePathError:
        raise
    except ERRORS:
        count = 0
    return count, found.result() if count else {}


def _remuxed(path: Path, whole: Path, found: PictureStatistics) -> int:
    """Copy a truncated video into an ordinary one, and count its pictures. Raises ``ERRORS``."""
    count = 0
    with av.open(str(path)) as source, av.open(str(whole), "w", format="mp4") as target:
        stream = target.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(video=0):
            if packet.dts is not None:
                packet.stream = stream
                target.mux(packet)
    found_picture: Any
    with av.open(str(whole)) as source:
        for found_picture in source.decode(video=0):
            if count % PICTURE_STRIDE == 0:
                found.add(found_picture.to_ndarray(format="rgb24"))
            count += 1
    whole.replace(path)
    return count
