"""Data sets in LeRobot's layouts (v3 and v2), also JOSHUA's, and ROS 2 recordings (MCAP, rosbag2)."""

from __future__ import annotations

from array import array
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from joshua.api.files import UnsafePathError, file_inside
from joshua.features import Feature, FeatureSet, Unit
from joshua.tools import parse_json

from joshua_mujoco_sim.trajectories.tables import (
    VECTOR_COLUMNS,
    from_columns,
    parquet_columns,
    read_csv,
    read_json_lines,
    read_parquet,
)
from joshua_mujoco_sim.trajectories.trajectory import Budget, Trajectory, TrajectoryError

JOINT_STATE = "sensor_msgs/msg/JointState"

#: Files of a data set by suffix; Parquet files may hold several episodes.
_EPISODE_FILES = {".csv": read_csv, ".jsonl": read_json_lines, ".parquet": read_parquet}


def is_lerobot(folder: Path) -> bool:
    """Return whether a folder is a LeRobot data set."""
    return (folder / "meta" / "info.json").is_file()


def is_rosbag(path: Path) -> bool:
    """Return whether a path is an MCAP file or the folder of a rosbag2 recording."""
    return path.suffix == ".mcap" or (path / "metadata.yaml").is_file()


def read_lerobot(folder: Path, episodes: Sequence[int], budget: Budget) -> list[Trajectory]:
    """Read the named episodes, or all, of a data set from LeRobot or JOSHUA.

    Raises:
        TrajectoryError: the data set is damaged, or has no such episode.
    """
    try:
        info = parse_json(file_inside(folder, "meta/info.json").read_text(encoding="utf-8"))
        features = FeatureSet.from_lerobot(info["features"])
        feature = next(features[name] for name in VECTOR_COLUMNS if name in features)
        unit = Unit(feature.unit).value if feature.unit else ""
    except (OSError, KeyError, TypeError, AttributeError, ValueError) as error:
        raise TrajectoryError(f"{folder}/meta/info.json does not describe a data set: {error}") from error
    except StopIteration:
        raise TrajectoryError(
            f"{folder} records neither {' nor '.join(VECTOR_COLUMNS)}: there is nothing to replay"
        ) from None
    if unit == Unit.LEROBOT.value:  # the names imply it, too; the values may be degrees
        unit = ""
    files = _episode_files(folder)
    if files and files[0].suffix != ".parquet":
        found = _from_text(folder, files, episodes, feature.names, budget)
    else:
        found = _from_parquet(folder, files, episodes, feature, budget)
    return [replace(trajectory, unit=unit) for trajectory in found]


def _episode_files(folder: Path) -> list[Path]:
    """List the files with episodes. Raises TrajectoryError for a link that leads out of the data set."""
    found = sorted((folder / "data").glob("chunk-*/*"))
    try:
        return [file_inside(folder, file) for file in found if file.suffix in _EPISODE_FILES]
    except UnsafePathError as error:
        raise TrajectoryError(str(error)) from error


def _from_text(
    folder: Path, files: Sequence[Path], episodes: Sequence[int], names: tuple[str, ...], budget: Budget
) -> list[Trajectory]:
    """Read episodes of a JOSHUA data set in text files with one episode each."""
    _require(folder, episodes, range(len(files)))
    found = [
        _EPISODE_FILES[files[number].suffix](files[number], budget)
        for number in list(episodes) or range(len(files))
    ]
    return [item if item.names else replace(item, names=names) for item in found]


def _from_parquet(
    folder: Path, files: Sequence[Path], episodes: Sequence[int], feature: Feature, budget: Budget
) -> list[Trajectory]:
    key = feature.key
    by_episode: dict[int, list[dict[str, Any]]] = {}
    numbers: set[int] = set()
    for file in files:
        columns = parquet_columns(file, Budget(), "timestamp", "episode_index")  # one file after the other
        if not {"timestamp", "episode_index", key} <= columns.keys():
            raise TrajectoryError(f"{file} has no timestamp, no episode_index or no {key}: it is damaged")
        here = columns["episode_index"]
        for number in map(int, np.unique(here)):
            numbers.add(number)
            if not episodes or number in episodes:
                part = {name: columns[name][here == number] for name in ("timestamp", key)}
                budget.take(folder, sum(values.size for values in part.values()))
                parts = by_episode.setdefault(number, [])
                parts.append(part)
                if part[key].shape[1:] != parts[0][key].shape[1:]:
                    raise TrajectoryError(f"{file}: {key} has another length than in the files before it")
    _require(folder, episodes, numbers)
    return [
        from_columns(f"{folder} episode {number}", _joined(by_episode[number]), feature.names)
        for number in list(episodes) or sorted(numbers)
    ]


def _require(folder: Path, episodes: Sequence[int], numbers: Collection[int]) -> None:
    missing = [number for number in episodes if number not in numbers]
    if not numbers:
        raise TrajectoryError(f"{folder} holds no episode")
    if missing:
        raise TrajectoryError(
            f"{folder} has no episode {', '.join(map(str, missing))}: it has 0 to {max(numbers)}"
        )


def read_rosbag(path: Path, budget: Budget) -> Trajectory:
    """Read the joint states of a recording: from the busiest topic of that type.

    Raises:
        TrajectoryError: the recording cannot be read, or holds no joint states.
    """
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            found = [connection for connection in reader.connections if connection.msgtype == JOINT_STATE]
            if not found:
                topics = ", ".join(f"{c.topic} ({c.msgtype})" for c in reader.connections) or "nothing"
                raise TrajectoryError(f"{path} holds no joint states: it has {topics}")
            busiest = max(found, key=lambda connection: connection.msgcount)
            names: tuple[str, ...] = ()
            times, positions = array("d"), array("d")
            for connection, stamp_ns, raw in reader.messages(connections=[busiest]):
                message: Any = reader.deserialize(raw, connection.msgtype)
                names = names or tuple(message.name)
                if tuple(message.name) != names:
                    raise TrajectoryError(f"{path}: {busiest.topic} changes its joints on the way")
                if len(message.position) != len(names):
                    raise TrajectoryError(
                        f"{path}: message {len(times) + 1} on {busiest.topic} has {len(names)} names and "
                        f"{len(message.position)} positions"
                    )
                budget.take(path, 1 + len(names))
                times.append(stamp_ns * 1e-9)
                positions.extend(message.position)
    except (AnyReaderError, OSError, ValueError) as error:
        raise TrajectoryError(f"{path} cannot be read as a ROS 2 recording: {error}") from error
    if not times:
        raise TrajectoryError(f"{path}: {busiest.topic} holds no message: record something first")
    time_s = np.frombuffer(times)
    position = np.frombuffer(positions).reshape(len(times), -1)
    return Trajectory(f"{path} {busiest.topic}", names, time_s - time_s[0], position)


def _joined(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
