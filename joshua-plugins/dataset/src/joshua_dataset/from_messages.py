"""Frames from recorded ROS 2 messages, aligned by acquisition time as the recorder aligns them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from joshua.api.files import UnsafePathError, file_inside
from joshua.features import Feature, Frame, Unit
from joshua.messages import MessageError, decode
from joshua.messages.arrays import acquired_ns, array_of

from joshua_dataset.as_messages import JOINT_STATE, SUFFIX, units_of
from joshua_dataset.bag import FILE, messages
from joshua_dataset.checks.problem import Kind
from joshua_dataset.metadata import ACQUISITION
from joshua_dataset.reader import Dataset, DatasetError, Episode
from joshua_dataset.sampler import Sampler
from joshua_dataset.settings import StoreSettings
from joshua_dataset.streams import Stream, picture

#: How many messages of a topic are read ahead, for its rate and its phase.
AHEAD = 30


def message_file(dataset: Dataset, episode: Episode) -> Path:
    """Return the file of an episode's messages. Raises DatasetError for one outside the data set."""
    try:
        return file_inside(dataset.folder, episode.table / FILE, "the messages")
    except UnsafePathError as error:
        raise DatasetError(f"{dataset.folder}: episode {episode.index}: {error}") from error


class MessageFrames:
    """The frames of one episode of messages.

    Args:
        dataset: of messages; episode: of it.

    Attributes:
        counts: frames that lacked a value; complete after the iteration.

    Raises:
        DatasetError: the data set does not say which topic carries which feature.
    """

    def __init__(self, dataset: Dataset, episode: Episode) -> None:
        self._features, self._identity = dataset.features, dataset.identity
        self._settings = StoreSettings(folder=str(dataset.folder), format="mcap", fps=dataset.fps)
        self._path = message_file(dataset, episode)
        topics = dataset.topics
        shown = [item for item in dataset.features.values() if item.key != ACQUISITION]
        lost = [item.key for item in shown if item.key not in topics]
        if lost:
            raise DatasetError(f"{dataset.folder} does not say which topic carries {', '.join(lost)}")
        self._streams = {topics[item.key]: Stream(replace(item, topic=topics[item.key])) for item in shown}
        self.counts: dict[str, int] = {}

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames. Raises DatasetError."""
        begin_ns = self._look_ahead()
        if begin_ns is None:
            return
        sampler = Sampler(self._streams.values(), self._settings, begin_ns)
        self.counts = sampler.counts
        now_ns = begin_ns
        for topic, type_name, record in messages(self._path):
            now_ns = max(now_ns, record.log_time)
            stream = self._streams.get(topic)
            if stream is None:
                continue
            message = self._decoded(topic, type_name, record.data)
            stamp_ns = stream.take(message, record.log_time)
            if not stream.is_latched:
                value = message if stream.feature.is_picture else self._numbers(stream.feature, message)
                sampler.push(stream.feature.key, stamp_ns, value)
            for frame in sampler.poll(now_ns):
                yield self._converted(frame)
        for frame in sampler.rest(now_ns):
            yield self._converted(frame)

    def _look_ahead(self) -> int | None:
        """Fill the streams with their first messages; return the first time, None without a message."""
        seen: Counter[str] = Counter()
        begin_ns = None
        for topic, type_name, record in messages(self._path):
            begin_ns = record.log_time if begin_ns is None else begin_ns
            stream = self._streams.get(topic)
            if stream is not None and seen[topic] < AHEAD:
                seen[topic] += 1
                stream.take(self._decoded(topic, type_name, record.data), record.log_time)
            waiting = [name for name, item in self._streams.items() if not item.is_latched]
            if all(seen[name] >= AHEAD for name in waiting) or record.log_time - begin_ns > 3_000_000_000:
                break
        return begin_ns

    def _decoded(self, topic: str, type_name: str, data: bytes) -> Any:
        try:
            return decode(type_name, data)
        except MessageError as error:
            raise DatasetError(f"{self._path}: a message of {topic} cannot be read: {error}") from error

    def _numbers(self, feature: Feature, message: Any) -> Any:
        """Return the numbers of a message, joints in the unit of the data set."""
        names = tuple(name.removesuffix(SUFFIX) for name in feature.names)
        try:
            values = np.asarray(array_of(message, names))
        except MessageError as error:
            raise DatasetError(f"{self._path}: a message of {feature.topic}: {error}") from error
        if type(message).__msgtype__ != JOINT_STATE or feature.unit in ("", "rad"):
            return values
        units = units_of(self._identity, feature.key)
        if units is None and feature.unit == "deg":
            return np.degrees(values)
        if units is None:
            raise DatasetError(f"{self._path}: {feature.key} has no calibration to convert it with")
        return units.from_radians(values, Unit(feature.unit))

    def _converted(self, frame: Frame) -> Frame:
        values: Mapping[str, Any] = {
            key: picture(value, self._features[key]) if self._features[key].is_picture else value
            for key, value in frame.values.items()
        }
        if ACQUISITION not in self._features:
            return replace(frame, values=values)
        keys = self._features[ACQUISITION].names
        stamps_ns = np.array([frame.stamps_ns.get(key, frame.stamp_ns) for key in keys], np.int64)
        return replace(frame, values={**values, ACQUISITION: stamps_ns})


def problems(dataset: Dataset, episode: Episode) -> Iterator[tuple[Kind, str, bool]]:
    """Yield kind and text of each problem of an episode of messages, and whether it is serious."""
    stamps: dict[str, list[int]] = {}
    path = message_file(dataset, episode)
    if not path.is_file():
        yield Kind.MESSAGES_MISSING, f"{path} is missing", True
        return
    count = 0
    for topic, type_name, record in messages(path):
        count += 1
        try:
            stamps.setdefault(topic, []).append(acquired_ns(decode(type_name, record.data), record.log_time))
        except MessageError as error:
            yield Kind.MESSAGES_TORN, f"a message of {topic} cannot be read: {error}", True
            return
    if count != episode.length:
        text = f"{path.name} has {count} intact messages, but {episode.length} are described"
        yield Kind.MESSAGES_TORN, text, True
    for key, topic in dataset.topics.items():
        if topic not in stamps and not Stream(dataset.features[key]).is_latched:
            yield Kind.MESSAGES_MISSING, f"it has no message of {topic}, which carries {key}", True
    for topic, found in stamps.items():
        steps_s = np.diff(np.array(found)) / 1e9
        if len(steps_s) and steps_s.min() <= 0:
            yield Kind.STAMPS, f"the stamps of {topic} do not increase", False
        gap_s = max(0.5, 5 * float(np.median(steps_s))) if len(steps_s) else 0.0
        if topic in dataset.topics.values() and len(steps_s) and steps_s.max() > gap_s:
            yield Kind.RECORDING_GAP, f"{topic} has no message for {steps_s.max():.2f} s", False
