"""Make a data set from episodes of others on all cores: convert, merge, split, delete."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from uuid import uuid4

from joshua.api.files import file_inside, free_name, inside, is_system_error, safe_name, tree_inside
from joshua.features import DatasetLayout, EpisodeError, FeatureError, FeatureSet, checked
from joshua.messages import decode
from joshua.tools import describe_pointer
from joshua_jobs.executor import Executor
from joshua_jobs.processes import in_order

from joshua_dataset import statistics
from joshua_dataset.bag import messages
from joshua_dataset.changes import aside_name, changing, is_interrupted
from joshua_dataset.files import aside_folder, linked, reason, remove_empty_folders
from joshua_dataset.formats import writer_of
from joshua_dataset.from_messages import MessageFrames, message_file
from joshua_dataset.lock import PRIVATE
from joshua_dataset.mcap_writer import McapWriter
from joshua_dataset.metadata import FOLDERS, INDEX_COLUMNS, MESSAGES, STAMP
from joshua_dataset.open_episode import SUFFIXES, open_folder
from joshua_dataset.pictures import ERRORS, Encoder, PictureFiles, Video
from joshua_dataset.reader import Dataset, DatasetError, Episode
from joshua_dataset.statistics import Statistics
from joshua_dataset.watching import Watch
from joshua_dataset.writer import DatasetWriter, NotKept

NS_PER_S = 1_000_000_000


@dataclass(frozen=True)
class Source:
    """Episodes of a data set, in order.

    Attributes:
        folder: of the data set; episodes: their indices, None for all.
    """

    folder: Path
    episodes: tuple[int, ...] | None = None


class DamagedEpisodeError(EpisodeError):
    """One episode cannot be read, so it cannot be written into another data set; the others may be."""


@dataclass(frozen=True)
class _Job:
    """One episode to be written into another data set.

    Attributes:
        is_linked: as of ``_fill``.
    """

    folder: Path
    episode: Episode
    layout: DatasetLayout
    scratch: Path
    is_linked: bool


@dataclass(frozen=True)
class _Prepared:
    """An episode whose files are complete; the columns of its numbers, and the statistics of its pictures."""

    scratch: Path
    columns: dict[str, Any]
    pictures: dict[str, Statistics]
    task: str
    counts: dict[str, int]


def build(
    sources: Sequence[Source],
    target: Path,
    *,
    table_format: str = "lerobot",
    codec: str = "",
    pictures: str = "",
    workers: Executor | int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> int:
    """Write the episodes of some data sets into a new one; return their number.

    Videos are copied where codec and layout agree, else re-encoded.

    Args:
        codec, pictures: of the new data set; "" takes those of the first source where it can.
        workers: an executor, or processes; None for one per core.
        progress: called with the numbers of finished episodes and of all episodes.

    Raises:
        EpisodeError, DatasetError: a source cannot be read, they do not match, or the target exists.
    """
    found = [Dataset.read(source.folder) for source in sources]
    layout = _layout(found, target, table_format, codec, pictures)
    writer_of(table_format)(layout).check()
    with changing(target) as change:
        count = _fill(sources, found, replace(layout, folder=change.made), table_format, workers, progress)
        change.put_made()
        change.commit()
    return count


def _fill(
    sources: Sequence[Source],
    found: Sequence[Dataset],
    layout: DatasetLayout,
    table_format: str,
    workers: Executor | int | None,
    progress: Callable[[int, int], None],
    *,
    is_linked: bool = False,
) -> int:
    """Write episodes into a new data set; return their number.

    Args:
        is_linked: pictures that stay as they are become links to the same files.

    Raises:
        OSError: the disk refuses it. EpisodeError, DatasetError: as ``build``.
    """
    writer = writer_of(table_format)(layout)
    writer.open()
    watch = Watch()
    try:
        made_of = [dataset.pictures == MESSAGES for dataset in found]
        if any(made_of):
            return _from_messages(sources, found, made_of, writer, progress)
        total = sum(_count(source, dataset) for source, dataset in zip(sources, found, strict=True))
        jobs = _jobs(sources, found, layout, watch, is_linked=is_linked)
        for done, prepared in enumerate(in_order(_prepare, jobs, workers), 1):
            prepared.scratch.replace(open_folder(layout.folder))
            writer.keep(prepared.columns, prepared.pictures, prepared.task, prepared.counts)
            progress(done, total)
        if not writer.episodes:
            raise EpisodeError("no episode was chosen: the new data set would be empty")
        watch.check()
        return writer.episodes
    except NotKept as error:
        raise error.error from error
    finally:
        shutil.rmtree(layout.folder / PRIVATE / "jobs", ignore_errors=True)
        writer.close()


def _from_messages(
    sources: Sequence[Source],
    found: Sequence[Dataset],
    made_of: Sequence[bool],
    writer: DatasetWriter,
    progress: Callable[[int, int], None],
) -> int:
    """Write the frames of recorded messages, one episode after the other; return their number."""
    if not all(made_of):
        other = found[made_of.index(True)].folder
        raise EpisodeError(
            f"{other} contains messages, but another data set contains frames: convert it before the merge"
        )
    total = sum(_count(source, dataset) for source, dataset in zip(sources, found, strict=True))
    for source, dataset in zip(sources, found, strict=True):
        wanted = None if source.episodes is None else set(source.episodes)
        for episode in dataset.episode_list(wanted):
            frames = MessageFrames(dataset, episode)
            for frame in frames:
                writer.add_frame(frame)
            writer.end_episode((episode.tasks or ("",))[0], frames.counts)
            progress(writer.episodes, total)
    return writer.episodes


def delete(
    folder: Path,
    episodes: Sequence[int],
    *,
    damaged: Collection[int] = (),
    workers: Executor | int | None = None,
) -> int:
    """Remove episodes from a data set; return how many are left. It is replaced as a whole, at the end.

    Files of others in the folder stay. Pictures take no space twice.

    Args:
        damaged: episodes that are left out, too. With any, the files as they were are moved aside, and not
            removed.

    Raises:
        EpisodeError, DatasetError: as ``build``, or another process writes the data set; it stays unchanged.
    """
    if not is_interrupted(folder):
        Dataset.read(folder)
    with changing(folder) as change:
        there = Dataset.read(folder)
        _check(folder, there, episodes)
        gone = {*episodes, *damaged}
        kept = tuple(number for number in range(there.episodes) if number not in gone)
        if there.pictures == MESSAGES:
            count = copied_messages(there, kept, change.made)
        else:
            layout = _layout([there], change.made, there.format, "", "")
            source = Source(folder, kept)
            count = _fill(
                [source], [there], layout, there.format, workers, lambda done, total: None, is_linked=True
            )
        if count != len(kept):  # the rows of the others are missing
            raise EpisodeError(
                f"{folder}: only {count} of the {len(kept)} episodes to keep are described. Nothing is "
                f"deleted. Run `joshua dataset check {folder}`"
            )
        if damaged:
            change.retire_all(free_name(aside_folder(folder), aside_name("delete")))
        else:
            change.retire_all()
        change.put_made()
        change.commit()
    for name in FOLDERS:
        remove_empty_folders(folder / name)
    return count


def copied_messages(dataset: Dataset, kept: Sequence[int], target: Path) -> int:
    """Write some episodes of messages into a new data set as they are; return their number."""
    features = [replace(item, topic=dataset.topics.get(item.key, "")) for item in dataset.features.values()]
    layout = replace(_layout([dataset], target, "mcap", "", ""), features=FeatureSet(features))
    with contextlib.closing(McapWriter(layout)) as writer:
        writer.open()
        for episode in dataset.episode_list(set(kept)):
            for topic, type_name, record in messages(message_file(dataset, episode)):
                message = decode(type_name, record.data)
                writer.add_message(topic, message, record.log_time, record.publish_time)
            writer.end_episode((episode.tasks or ("",))[0], episode.counts)
        return writer.episodes


def _layout(
    found: Sequence[Dataset], target: Path, table_format: str, codec: str, pictures: str
) -> DatasetLayout:
    first = found[0]
    for other in found[1:]:
        different = first.features.differences(
            other.features, here=str(first.folder), there=str(other.folder)
        )
        if first.fps != other.fps:
            different.append(f"fps is {first.fps} in {first.folder} and {other.fps} in {other.folder}")
        if first.robot_type != other.robot_type:
            different.append(f"robot_type is {first.robot_type} and {other.robot_type}")
        if different:
            raise EpisodeError("the data sets cannot be merged: " + "; ".join(different))
    kept = pictures or (
        "video" if table_format == "lerobot" or first.pictures in ("table", MESSAGES) else first.pictures
    )
    return DatasetLayout(
        folder=target,
        robot_type=first.robot_type,
        fps=first.fps,
        features=FeatureSet(first.features.values()),
        codec=codec or (first.codec if first.codec in ("h264", "hevc", "av1") else "h264"),
        pictures=kept,
        identity=first.identity if all(other.identity == first.identity for other in found) else {},
        counters=first.counters,
    )


def _check(folder: Path, dataset: Dataset, episodes: Sequence[int]) -> None:
    beyond = [number for number in episodes if not 0 <= number < dataset.episodes]
    if beyond:
        raise EpisodeError(f"{folder} has no episode {beyond[0]}; allowed: 0 to {dataset.episodes - 1}")


def _count(source: Source, dataset: Dataset) -> int:
    if source.episodes is None:
        return dataset.episodes
    _check(source.folder, dataset, source.episodes)
    return len(set(source.episodes))


def _jobs(
    sources: Sequence[Source],
    found: Sequence[Dataset],
    layout: DatasetLayout,
    watch: Watch,
    *,
    is_linked: bool,
) -> Iterator[_Job]:
    number = 0
    for source, dataset in zip(sources, found, strict=True):
        wanted = None if source.episodes is None else set(source.episodes)
        for episode in dataset.episode_list(wanted):
            scratch = layout.folder / PRIVATE / "jobs" / f"{number:06d}"
            with contextlib.suppress(FileNotFoundError):  # the job says so
                watch.add(episode.table)
            yield _Job(source.folder, episode, layout, scratch, is_linked)
            number += 1


def _prepare(job: _Job) -> _Prepared:
    """Make the files of an episode (in a separate process, perhaps on another machine).

    In a folder of its own: a worker that seems lost may still write while another one repeats its job.
    """
    try:
        return _prepared(replace(job, scratch=job.scratch.with_name(f"{job.scratch.name}-{uuid4().hex}")))
    except DatasetError as error:
        raise DamagedEpisodeError(f"episode {job.episode.index} of {job.folder}: {error}") from error


def _prepared(job: _Job) -> _Prepared:
    dataset, episode, layout = Dataset.read(job.folder), job.episode, job.layout
    columns = dataset.columns(episode)
    if STAMP not in columns:  # LeRobot's own recordings have only the time of the index
        columns[STAMP] = (columns["timestamp"].astype("float64") * NS_PER_S).round().astype("int64")
    try:
        kept = {feature.key: _numbers(feature, columns[feature.key]) for feature in layout.features.numbers}
    except FeatureError as error:
        raise DamagedEpisodeError(f"episode {episode.index} of {job.folder}: {error}") from error
    kept[STAMP] = columns[STAMP]
    assert not set(kept) & (set(INDEX_COLUMNS) - {STAMP})
    inside(layout.folder, job.scratch).mkdir(parents=True, exist_ok=True)
    pictures = {feature.key: _pictures(job, dataset, feature.key) for feature in layout.features.pictures}
    return _Prepared(job.scratch, kept, pictures, (episode.tasks or ("",))[0], dict(episode.counts))


def _numbers(feature: Any, values: Any) -> Any:
    return checked(replace(feature, shape=values.shape), values)


def _pictures(job: _Job, dataset: Dataset, key: str) -> Statistics:
    """Copy or encode the pictures of one feature; return their statistics."""
    layout, episode = job.layout, job.episode
    path = job.scratch / f"{safe_name(key, 'the feature')}{SUFFIXES[layout.pictures]}"
    where = episode.pictures[key]
    pointer = describe_pointer(where.path)
    if pointer is not None:
        raise DamagedEpisodeError(f"episode {episode.index} of {job.folder}: {'. '.join(pointer)}")
    known = {name: values for name, values in episode.statistics.get(key, {}).items() if values is not None}
    own_file = dataset.format != "lerobot" or "joshua" in dataset.info
    if own_file and layout.pictures == dataset.pictures and layout.codec == dataset.codec and known:
        copy = linked if job.is_linked else shutil.copyfile
        if where.path.is_dir():
            tree_inside(job.folder, where.path, "the pictures")
            shutil.copytree(where.path, path, copy_function=copy)
        else:
            file_inside(job.folder, where.path, "the video")
            copy(where.path, path)
        try:
            return statistics.from_json(known)
        except (TypeError, ValueError) as error:
            raise DamagedEpisodeError(
                f"episode {episode.index} of {job.folder}: the statistics of {key} are not valid: {error}"
            ) from error
    height, width, _ = layout.features[key].shape
    target = (
        Video(path, width, height, layout.fps, layout.codec)
        if layout.pictures == "video"
        else PictureFiles(path, ".png" if layout.pictures == "png" else ".jpg")
    )
    encoder = Encoder(target, key, 2 * layout.fps)
    count = 0
    try:
        for picture in dataset.decoded(episode, key):
            encoder.add(picture)
            count += 1
        found = encoder.finish() if count else {}
    except (DatasetError, *ERRORS) as error:
        encoder.drop()
        kind = EpisodeError if is_system_error(error) else DamagedEpisodeError
        raise kind(f"episode {episode.index} of {job.folder}: {key}: {reason(error)}") from error
    if count != episode.length:
        raise DamagedEpisodeError(
            f"episode {episode.index} of {job.folder}: {key} has {count} pictures, "
            f"and {episode.length} are described"
        )
    return found
