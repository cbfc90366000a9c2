"""Writes a data set of ROS 2 messages: each episode is a rosbag2 folder with an MCAP file."""

from __future__ import annotations

import contextlib
import shutil
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pyarrow as pa
from joshua.api.files import file_inside, inside
from joshua.features import DatasetLayout, EpisodeError, Frame
from joshua.messages import MessageError, encode

from joshua_dataset import metadata, open_episode
from joshua_dataset.as_messages import Messages, topic_of
from joshua_dataset.bag import FILE, Bag, completed
from joshua_dataset.changes import Change
from joshua_dataset.files import Files, reason
from joshua_dataset.metadata import ACQUISITION, INFO, MESSAGES, OURS, TASKS
from joshua_dataset.open_episode import Syncer, open_folder
from joshua_dataset.pictures import ERRORS
from joshua_dataset.writer import DatasetWriter, Decided

#: Folder of an episode's bag.
BAG_PATH = "data/chunk-{chunk_index:03d}/episode-{file_index:03d}"

_BAG = "bag"


class McapWriter(DatasetWriter):
    """See ``DatasetWriter``; accepts messages as received, or makes them from frames.

    Its frames are messages.
    """

    format = "mcap"

    def __init__(self, layout: DatasetLayout, files: Files | None = None) -> None:
        super().__init__(replace(layout, pictures=MESSAGES), files)
        self._bag: Bag | None = None
        self._syncer: Syncer | None = None
        self._has_failed = self._is_closed = False
        self._made = Messages(layout)
        self._encoding_s = 0.0

    @property
    def open_frames(self) -> int:
        """Number of messages in the open episode."""
        return self._bag.count if self._bag is not None else 0

    @property
    def open_s(self) -> float:
        """Length of the open episode."""
        return self._bag.length_s if self._bag is not None else 0.0

    @property
    def busy_s(self) -> float:
        """Processor time spent on messages."""
        return self._encoding_s

    def add_message(self, topic: str, message: Any, log_ns: int, publish_ns: int) -> None:
        """Add a message to the open episode. Raises EpisodeError."""
        began_s = time.thread_time()
        if self._has_failed:
            raise EpisodeError(f"{self.layout.folder} takes no message: the episode has ended with an error")
        try:
            if self._bag is None:
                self._bag = self._opened()
                self._syncer = Syncer(self._sync)
            if self._syncer is not None and self._syncer.error is not None:
                raise self._syncer.error
            self._bag.add(topic, type(message).__msgtype__, encode(message), log_ns, publish_ns)
        except (OSError, MessageError) as error:
            self._has_failed = self._bag is not None and isinstance(error, OSError)
            raise EpisodeError(
                f"{self.layout.folder} takes no message of {topic}: {reason(error)}"
            ) from error
        self._encoding_s += time.thread_time() - began_s

    def add_frame(self, frame: Frame) -> None:
        """See ``EpisodeWriter``."""
        for topic, message in self._made.of_frame(frame.stamp_ns, frame.values):
            self.add_message(topic, message, frame.stamp_ns, frame.stamp_ns)

    def end_episode(self, task: str, counts: Mapping[str, int] | None = None) -> None:
        """See ``EpisodeWriter``."""
        if self._bag is None:
            raise EpisodeError(f"{self.layout.folder}: an episode without a message cannot be kept")
        self._end_sync()
        if self._decided is not None:
            self._complete_decided()
        else:
            try:
                self._bag.close()
            except OSError as error:
                self._has_failed = True
                raise self._not_kept(error) from error
            self._is_closed = True
            self._keep_bag(self._bag, task, counts or {}, is_damaged=False)
        self._forget()

    def drop_episode(self) -> None:
        """See ``DatasetWriter``."""
        if self._bag is None:
            return
        self._end_sync()
        if self._decided is not None:
            with contextlib.suppress(EpisodeError):  # it stays the open episode
                self._complete_decided()
                self._forget()
            return
        self._bag.drop()
        self._forget()
        open_episode.remove(self.layout.folder)

    def leave(self) -> None:
        """See ``DatasetWriter``."""
        if self._bag is not None:
            self._end_sync()
            self._bag.drop()
            self._forget()
        self._decided = None
        super().leave()

    def close(self) -> None:
        """See ``DatasetWriter``."""
        if self._bag is not None and (self._has_failed or self._is_closed):
            self.leave()
            return
        super().close()

    def complete(self, task: str, counts: Mapping[str, int]) -> float:
        """Keep what is whole of the open episode on the disk; return its length in seconds, 0 for none.

        Raises:
            EpisodeError: the system does not let it be read or kept; everything stays where it is.
        """
        folder = open_folder(self.layout.folder)
        try:
            whole = inside(self.layout.folder, folder / "whole", "the messages")
            file_inside(self.layout.folder, folder / _BAG / FILE, "the messages")
            if whole.exists():  # a copy of a repair that did not come to its end
                shutil.rmtree(whole)
            bag, is_damaged = completed(folder / _BAG, whole)
            if bag is None:
                return 0.0
        except (*ERRORS, pa.ArrowException) as error:
            raise self._not_kept(error) from error
        self._keep_bag(bag, task, counts, is_damaged=is_damaged)
        return bag.length_s

    def _opened(self) -> Bag:
        folder = open_episode.begin(self.layout.folder, self.episodes, self._journal(), self._files)
        return Bag(folder / _BAG)

    def _sync(self) -> None:
        folder = open_folder(self.layout.folder) / _BAG
        self._files.sync(folder / FILE)
        self._files.sync_folder(folder)

    def _end_sync(self) -> None:
        if self._syncer is not None:
            self._syncer.stop()

    def _forget(self) -> None:
        self._bag = self._syncer = None
        self._has_failed = self._is_closed = False

    def _keep_bag(self, bag: Bag, task: str, counts: Mapping[str, int], *, is_damaged: bool) -> None:
        folder, place = self.layout.folder, metadata.place(self.episodes)
        tasks = self._tasks if task in self._tasks else [*self._tasks, task]
        row: dict[str, Any] = {
            "episode_index": self.episodes,
            "tasks": [task],
            "length": bag.count,
            "length_s": bag.length_s,
            "data/chunk_index": place["chunk_index"],
            "data/file_index": place["file_index"],
            "dataset_from_index": self.frames,
            "dataset_to_index": self.frames + bag.count,
            **{f"counts/{name}": int(counts.get(name, 0)) for name in self.layout.counters},
        }
        change = Change(folder, self._files)
        try:
            change.begin()
            target = folder / BAG_PATH.format(**place)
            change.clear(target)
            change.put(bag.folder, target)
            change.table(folder / metadata.EPISODES_PATH.format(**place), pa.Table.from_pylist([row]))
            if tasks != self._tasks:
                change.table(folder / TASKS, metadata.tasks_table(tasks))
            info = self._info(self.episodes + 1, self.frames + bag.count, len(tasks))
            change.json(folder / INFO, info, last=True)
            aside = self._clear(change, is_damaged)
        except (*ERRORS, pa.ArrowException) as error:
            change.discard()
            raise self._not_kept(error) from error
        self._decided = Decided(change, bag.count, {}, tasks, aside)
        self._complete_decided()

    def _info(self, episodes: int, messages: int, tasks: int) -> dict[str, Any]:
        info = metadata.info(self.layout, self.format, episodes=episodes, frames=messages, tasks=tasks)
        return info | {
            "data_path": BAG_PATH,
            "video_path": None,
            OURS: info[OURS] | {"codec": "", "topics": self._topics()},
        }

    def _topics(self) -> dict[str, str]:
        """Return the topic of each feature."""
        features = self.layout.features.values()
        return {item.key: item.topic or topic_of(item) for item in features if item.key != ACQUISITION}

    def _take_up(self, there: Any) -> None:
        self.episodes, self.frames, self._tasks = there.episodes, there.frames, list(there.tasks)
