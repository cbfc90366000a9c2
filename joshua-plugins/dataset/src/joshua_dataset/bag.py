"""One episode as a rosbag2 folder: an MCAP file with ROS 2 messages and their schemas, and its metadata."""

from __future__ import annotations

import io
import json
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from joshua.messages.typestore import definitions, distro, type_hash

from joshua_dataset.files import PatientFile

FILE = "messages.mcap"
METADATA = "metadata.yaml"

#: A chunk is written when it is full, so a small one limits what a kill can lose.
CHUNK_BYTES = 4096

#: Longest time before written data is flushed to the operating system.
FLUSH_S = 0.25


@dataclass
class _Topic:
    """One channel of a bag."""

    name: str
    type_name: str
    channel: int
    count: int = 0


class Bag:
    """Writer of one episode.

    Args:
        folder: of the bag, which is created.

    Attributes:
        count: of messages; begin_ns, end_ns: first and last log time, 0 without messages.

    Raises:
        OSError: writing fails. The methods raise it, too.
    """

    def __init__(self, folder: Path) -> None:
        from mcap.writer import CompressionType, Writer

        folder.mkdir(parents=True)
        self.folder = folder
        self.count = self.begin_ns = self.end_ns = 0
        self._topics: dict[str, _Topic] = {}
        self._schemas: dict[str, int] = {}
        self._disk = PatientFile(folder / FILE)
        self._file = io.BufferedWriter(self._disk)
        self._is_finished = False
        self._flushed_s = time.monotonic()
        self._writer: Any = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.NONE)
        self._writer.start(profile="ros2", library="joshua-dataset")

    @property
    def length_s(self) -> float:
        """Time from the first to the last message."""
        return (self.end_ns - self.begin_ns) / 1e9

    def add(self, topic: str, type_name: str, data: bytes, log_ns: int, publish_ns: int) -> None:
        """Add a message.

        Args:
            data: CDR with its encapsulation header; log_ns: when it was received; publish_ns: its stamp.
        """
        there = self._topics.get(topic) or self._declared(topic, type_name)
        self._writer.add_message(there.channel, log_ns, data, publish_ns, there.count)
        there.count += 1
        self.begin_ns = min(self.begin_ns, log_ns) if self.count else log_ns
        self.end_ns = max(self.end_ns, log_ns)
        self.count += 1
        now_s = time.monotonic()
        if now_s - self._flushed_s > FLUSH_S:
            self._file.flush()
            self._flushed_s = now_s
        if self._disk.error is not None:
            raise self._disk.error

    def close(self) -> None:
        """Complete the file and write the metadata, without which rosbag2 does not open the folder.

        After an error of the disk, call it again when the cause is removed: no message is lost.
        """
        if not self._is_finished:
            self._writer.finish()
            self._file.flush()
            self._is_finished = True
        self._disk.push()
        self._file.close()
        (self.folder / METADATA).write_text(json.dumps(self._metadata(), indent=1) + "\n", encoding="utf-8")

    def drop(self) -> None:
        """Close the file, complete or not."""
        self._file.close()

    def _declared(self, topic: str, type_name: str) -> _Topic:
        if type_name not in self._schemas:
            text, _ = definitions().generate_msgdef(type_name, ros_version=2)
            self._schemas[type_name] = self._writer.register_schema(type_name, "ros2msg", text.encode())
        described = {"offered_qos_profiles": "", "topic_type_hash": type_hash(type_name)}
        channel = self._writer.register_channel(topic, "cdr", self._schemas[type_name], described)
        self._topics[topic] = made = _Topic(topic, type_name, channel)
        return made

    def _metadata(self) -> dict[str, Any]:
        """Return rosbag2's metadata of a bag as JSON, which is valid YAML."""
        span = {
            "starting_time": {"nanoseconds_since_epoch": self.begin_ns},
            "duration": {"nanoseconds": self.end_ns - self.begin_ns},
            "message_count": self.count,
        }
        topics = [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": "",
                    "type_description_hash": type_hash(topic.type_name),
                },
                "message_count": topic.count,
            }
            for topic in self._topics.values()
        ]
        return {
            "rosbag2_bagfile_information": {
                "version": 8,
                "storage_identifier": "mcap",
                "relative_file_paths": [FILE],
                **span,
                "topics_with_message_count": topics,
                "compression_format": "",
                "compression_mode": "",
                "files": [{"path": FILE, **span}],
                "custom_data": None,
                "ros_distro": distro(),
            }
        }


def completed(torn: Path, folder: Path) -> tuple[Bag | None, bool]:
    """Copy the whole messages of an unfinished bag into a complete one.

    Returns:
        The new bag, None without a message; and whether the file is damaged in a way that a kill does not
        explain.

    Raises:
        OSError: the system does not let the bag be read or written.
    """
    bag = None
    source = Messages(torn / FILE)
    for topic, type_name, message in source:
        if bag is None:
            bag = Bag(folder)
        bag.add(topic, type_name, message.data, message.log_time, message.publish_time)
    if bag is not None:
        bag.close()
    return bag, source.is_damaged


def messages(path: Path) -> Iterator[tuple[str, str, Any]]:
    """Yield topic, type and record of each intact message in a file."""
    yield from Messages(path)


class Messages:
    """The intact messages of a file, up to the first record that is not whole.

    Args:
        path: of the file.

    Attributes:
        is_damaged: after the iteration: something other than the end of the file is missing.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.is_damaged = False

    def __iter__(self) -> Iterator[tuple[str, str, Any]]:
        from mcap.exceptions import McapError
        from mcap.records import Channel, Message, Schema
        from mcap.stream_reader import StreamReader

        channels: dict[int, Channel] = {}
        schemas: dict[int, Schema] = {}
        if not self._path.exists():
            return
        size = self._path.stat().st_size
        with self._path.open("rb") as file:
            records = iter(StreamReader(file, validate_crcs=True).records)
            while True:
                try:
                    record = next(records)
                except StopIteration:
                    return
                except (McapError, ValueError, EOFError, IndexError, KeyError, struct.error):
                    # a torn record ends with the file
                    self.is_damaged = file.tell() < size
                    return
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Message):
                    channel = channels.get(record.channel_id)
                    if channel is None or channel.schema_id not in schemas:
                        self.is_damaged = True
                        return
                    yield channel.topic, schemas[channel.schema_id].name, record
