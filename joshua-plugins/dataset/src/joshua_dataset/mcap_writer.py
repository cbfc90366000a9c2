"""Writes a data set of ROS 2 messages: each episode is a rosbag2 folder with an MCAP file."""

from __future__ import annotations

import json
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
from joshua_dataset.files import Files, Staging, reason
from joshua_dataset.metadata import ACQUISITION, INFO, MESSAGES, OURS, TASKS
from joshua_dataset.open_episode import JOURNAL, open_folder
from joshua_dataset.pictures import ERRORS
from joshua_dataset.writer import DatasetWriter

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
        try:
            if self._bag is None:
                self._bag = self._opened()
            self._bag.add(topic, type(message).__msgtype__, encode(message), log_ns, publish_ns)
        except (OSError, MessageError) as error:
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
        try:
            self._bag.close()
        except OSError as error:
            raise self._not_kept(error) from error
        self._keep_bag(self._bag, task, counts or {})
        self._bag = None

    def drop_episode(self) -> None:
        """See ``EpisodeWriter``."""
        if self._bag is not None:
            self._bag.drop()
            self._bag = None
            open_episode.remove(self.layout.folder)

    def complete(self, journal: Mapping[str, Any]) -> float:
        """Keep what a kill has left of the open episode; return its length in seconds, 0 if nothing is left.

        Raises:
            EpisodeError: writing fails.
        """
        folder = open_folder(self.layout.folder)
        whole = inside(self.layout.folder, folder / "whole", "the messages")
        placed = inside(self.layout.folder, BAG_PATH.format(**metadata.place(self.episodes)), "the episode")
        if placed.exists() and not (folder / _BAG).exists():  # the kill came before it was counted
            placed.replace(folder / _BAG)
        shutil.rmtree(whole, ignore_errors=True)
        file_inside(self.layout.folder, folder / _BAG / FILE, "the messages")
        bag = completed(folder / _BAG, whole)
        if not bag.count:
            open_episode.remove(self.layout.folder)
            return 0.0
        self._keep_bag(bag, str(journal.get("task", "")), {})
        return bag.length_s

    def _opened(self) -> Bag:
        folder = open_folder(self.layout.folder)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        journal = {"episode_index": self.episodes, **self._journal()}
        (folder / JOURNAL).write_text(json.dumps(journal), encoding="utf-8")
        return Bag(folder / _BAG)

    def _keep_bag(self, bag: Bag, task: str, counts: Mapping[str, int]) -> None:
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
        staging = Staging(self._files, folder)
        try:
            staging.move(bag.folder, folder / BAG_PATH.format(**place))
            staging.table(folder / metadata.EPISODES_PATH.format(**place), pa.Table.from_pylist([row]))
            if tasks != self._tasks:
                staging.table(folder / TASKS, metadata.tasks_table(tasks))
            staging.json(folder / INFO, self._info(self.episodes + 1, self.frames + bag.count, len(tasks)))
            staging.commit()
        except (*ERRORS, pa.ArrowException) as error:
            staging.discard()
            raise self._not_kept(error) from error
        self._tasks = tasks
        self.episodes += 1
        self.frames += bag.count
        open_episode.remove(folder)

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
