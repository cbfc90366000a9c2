"""Export a data set for other viewers: MCAP for Foxglove and rosbag2, ``.rrd`` for Rerun."""

from __future__ import annotations

import contextlib
import importlib
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from joshua.features import DatasetLayout, EpisodeError, FeatureSet, Frame
from joshua.tools import install

from joshua_dataset.changes import changing
from joshua_dataset.files import Files, reason
from joshua_dataset.mcap_writer import McapWriter
from joshua_dataset.metadata import STAMP
from joshua_dataset.pictures import encoded
from joshua_dataset.reader import Dataset, DatasetError, Episode

Progress = Callable[[int, int], None]


def export(folder: Path, target: Path, kind: str, progress: Progress = lambda done, total: None) -> int:
    """Write the episodes of a data set for a viewer; return their number.

    The target appears as a whole: after an error or a kill, there is no part of it.

    Args:
        target: new folder; kind: ``mcap`` or ``rerun``.

    Raises:
        EpisodeError, DatasetError: the data set cannot be read, the target exists or cannot be written, or a
            library is missing.
    """
    dataset = Dataset.read(folder)
    write = _mcap if kind == "mcap" else _rerun
    for done in write(dataset, target):
        progress(done, dataset.episodes)
    return dataset.episodes


def _frames(dataset: Dataset, episode: Episode) -> Iterator[Frame]:
    """Yield the frames of an episode; their times follow the frame index if none are recorded."""
    columns = dataset.columns(episode)
    pictures = {item.key: dataset.decoded(episode, item.key) for item in dataset.features.pictures}
    for number in range(episode.length):
        try:
            values: dict[str, Any] = {key: next(stream) for key, stream in pictures.items()}
        except StopIteration:
            raise DatasetError(
                f"episode {episode.index} of {dataset.folder} has fewer than {episode.length} pictures"
            ) from None
        values |= {item.key: columns[item.key][number] for item in dataset.features.numbers}
        stamp_ns = columns[STAMP][number] if STAMP in columns else columns["timestamp"][number] * 1e9
        yield Frame(int(stamp_ns), values)


def _mcap(dataset: Dataset, target: Path) -> Iterator[int]:
    layout = DatasetLayout(
        folder=target,
        robot_type=dataset.robot_type,
        fps=dataset.fps,
        features=FeatureSet(dataset.features.values()),
        identity=dataset.identity,
        counters=dataset.counters,
    )
    McapWriter(layout).check()
    with changing(target) as change:
        try:
            yield from _messages(dataset, replace(layout, folder=change.made))
        except EpisodeError as error:
            if isinstance(error.__cause__, OSError):  # of the disk; the message names the private folder
                raise error.__cause__ from error
            raise
        change.put_made()
        change.commit()


def _messages(dataset: Dataset, layout: DatasetLayout) -> Iterator[int]:
    """Write the messages of each episode; yield their number so far."""
    with contextlib.closing(McapWriter(layout)) as writer:
        writer.open()
        for done, episode in enumerate(dataset.episode_list(), 1):
            for frame in _frames(dataset, episode):
                writer.add_frame(frame)
            writer.end_episode((episode.tasks or ("",))[0], episode.counts)
            yield done


def _rerun(dataset: Dataset, target: Path) -> Iterator[int]:
    rerun = _library()
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise EpisodeError(f"{target} exists: name a new folder")
    files = Files()
    part = target.with_name(f".{target.name}.part")
    try:
        shutil.rmtree(part, ignore_errors=True)  # of an export that was killed
        files.make_folder(part)
        yield from _recordings(rerun, dataset, part)
        for path in part.iterdir():
            files.sync(path)
        files.replace(part, target)
    except OSError as error:
        raise EpisodeError(f"{target} cannot be written: {reason(error)}") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _recordings(rerun: Any, dataset: Dataset, target: Path) -> Iterator[int]:
    """Write each episode into a recording of its own; yield their number so far."""
    for done, episode in enumerate(dataset.episode_list(), 1):
        name = f"episode-{episode.index:06d}"
        stream = rerun.RecordingStream(f"joshua {dataset.folder.name}", recording_id=name)
        stream.save(target / f"{name}.rrd")
        for feature in dataset.features.numbers:
            if feature.names:
                stream.log(_entity(feature.key), rerun.SeriesLines(names=list(feature.names)), static=True)
        for number, frame in enumerate(_frames(dataset, episode)):
            stream.set_time("frame", sequence=number)
            stream.set_time("time", timestamp=frame.stamp_ns / 1e9)
            for feature in dataset.features.values():
                value = frame[feature.key]
                if feature.is_picture:
                    shown = rerun.EncodedImage(contents=encoded(value, png=False), media_type="image/jpeg")
                else:
                    shown = rerun.Scalars(value.astype("float64").ravel())
                stream.log(_entity(feature.key), shown)
        stream.flush()
        stream.disconnect()
        yield done


def _entity(key: str) -> str:
    return key.replace(".", "/")


def _library() -> Any:
    try:
        return importlib.import_module("rerun")
    except ImportError as error:
        raise EpisodeError(
            f"an export to Rerun requires rerun-sdk: {install('joshua-dataset', 'rerun')}"
        ) from error
