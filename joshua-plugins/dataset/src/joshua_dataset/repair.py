"""Complete or discard the episode that a killed writer left unfinished."""

from __future__ import annotations

import contextlib
import shutil
from pathlib import Path
from typing import Any

import av
from joshua.features import DatasetLayout, EpisodeError, FeatureSet

from joshua_dataset import open_episode
from joshua_dataset.formats import writer_of
from joshua_dataset.mcap_writer import McapWriter
from joshua_dataset.metadata import INFO, OURS, pictures_of, place
from joshua_dataset.open_episode import columns_of, pictures_path
from joshua_dataset.pictures import ERRORS, PICTURE_STRIDE
from joshua_dataset.reader import Dataset, DatasetError, picture_of
from joshua_dataset.statistics import PictureStatistics, Statistics
from joshua_dataset.writer import DatasetWriter


def repair(folder: Path, *, cut: bool = False) -> str:
    """Repair a data set after a kill or a power cut. Idempotent.

    Args:
        folder: of the data set; cut: discard the unfinished episode instead of completing it.

    Returns:
        What was done, in one sentence.

    Raises:
        EpisodeError: the folder is being written, is not a data set, or cannot be written.
    """
    if not (folder / INFO).exists() and open_episode.read_journal(folder) is None:
        raise EpisodeError(f"{folder} is not a data set: it has no {INFO}")
    journal = open_episode.read_journal(folder)
    layout, writer_type = _layout(folder, journal)
    writer = writer_type(layout)
    try:
        writer.take_up()
        for path in [*folder.glob("data/**/*.new"), *folder.glob("meta/**/*.new")]:
            path.unlink()
        return _repair(writer, journal, cut=cut)
    except OSError as error:
        raise EpisodeError(f"{folder} cannot be repaired: {error.strerror or error}") from error
    finally:
        writer.close()


def _layout(folder: Path, journal: dict[str, Any] | None) -> tuple[DatasetLayout, type[DatasetWriter]]:
    """Return what the journal says about the data set; without one, nothing of it is needed."""
    info = (journal or {}).get("info")
    if not isinstance(info, dict):
        kind = "lerobot"
        if journal is None:
            with contextlib.suppress(DatasetError):  # the writer says what is wrong
                kind = Dataset.read(folder).format
        return DatasetLayout(folder, "", 1, FeatureSet()), writer_of(kind)
    try:
        ours = info[OURS]
        layout = DatasetLayout(
            folder=folder,
            robot_type=info["robot_type"],
            fps=info["fps"],
            features=FeatureSet.from_lerobot(info["features"]),
            codec=ours["codec"],
            pictures=ours["pictures"],
            identity=ours["identity"],
            counters=tuple(ours["counters"]),
        )
        return layout, writer_of(ours["format"])
    except (KeyError, TypeError, ValueError) as error:
        raise EpisodeError(
            f"{open_episode.open_folder(folder)} has a journal that is not valid ({error}). "
            f"Run `joshua dataset repair --cut {folder}` to discard that episode"
        ) from error


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
        _remove_placed(layout, number)
        open_episode.remove(folder)
        return (
            f"the unfinished episode {max(number, 0)} is discarded; {writer.episodes} episodes are complete"
        )
    pictures: dict[str, Statistics] = {}
    length = len(rows)
    for feature in layout.features.pictures:
        count, pictures[feature.key] = _pictures(layout, feature.key, number)
        length = min(length, count)
    if not length:
        open_episode.remove(folder)
        return f"no frame of the unfinished episode {number} has all its parts; it is discarded"
    columns = {name: values[:length] for name, values in columns_of(rows).items()}
    writer.keep(columns, pictures, str(journal.get("task", "")), {})
    return f"episode {number} is completed with {length} frames ({length / layout.fps:.1f} s)"


def _remove_placed(layout: DatasetLayout, number: int) -> None:
    """Remove files that an interrupted commit has put in place; no reader counts them."""
    for feature in layout.features.pictures:
        path = layout.folder / pictures_of(layout, feature.key).format(**place(max(number, 0)))
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)


def _pictures(layout: DatasetLayout, key: str, number: int) -> tuple[int, Statistics]:
    """Complete the pictures of the unfinished episode; return their number and statistics."""
    path = pictures_path(layout, key)
    placed = layout.folder / pictures_of(layout, key).format(**place(number))
    if not path.exists() and placed.exists():
        placed.replace(path)
    found, count = PictureStatistics(), 0
    height, width, _ = layout.features[key].shape
    try:
        if path.is_dir():
            for file in sorted(path.iterdir()):
                try:
                    picture = picture_of(file.read_bytes(), file, height, width)
                except (DatasetError, *ERRORS):
                    file.unlink()  # the last one, truncated
                    continue
                if count % PICTURE_STRIDE == 0:
                    found.add(picture)
                count += 1
        elif path.exists():
            count = _remuxed(path, found)
    except ERRORS:
        count = 0
    return count, found.result() if count else {}


def _remuxed(path: Path, found: PictureStatistics) -> int:
    """Copy a truncated video into an ordinary one, and count its pictures. Raises ``ERRORS``."""
    whole = path.with_suffix(".whole")
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
