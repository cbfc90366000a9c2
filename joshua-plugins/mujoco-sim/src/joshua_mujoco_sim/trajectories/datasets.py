"""LeRobot data sets (v3 layout) and ROS 2 recordings (MCAP, rosbag2)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from joshua_mujoco_sim.trajectories.tables import VECTOR_COLUMNS, from_columns, parquet_columns
from joshua_mujoco_sim.trajectories.trajectory import Trajectory, TrajectoryError

JOINT_STATE = "sensor_msgs/msg/JointState"


def is_lerobot(folder: Path) -> bool:
    """Whether a folder is a LeRobot data set."""
    return (folder / "meta" / "info.json").is_file()


def is_rosbag(path: Path) -> bool:
    """Whether a path is an MCAP file or the folder of a rosbag2 recording."""
    return path.suffix == ".mcap" or (path / "metadata.yaml").is_file()


def read_lerobot(folder: Path, episodes: Sequence[int] = ()) -> list[Trajectory]:
    """Reads the episodes of a data set, all of them where none is named.

    Raises:
        TrajectoryError: the data set is damaged, or has no such episode.
    """
    try:
        info = json.loads((folder / "meta" / "info.json").read_text(encoding="utf-8"))
        features = info["features"]
        key = next(name for name in VECTOR_COLUMNS if name in features)
        names = _feature_names(features[key])
    except (OSError, json.JSONDecodeError, KeyError, TypeError) as error:
        raise TrajectoryError(f"{folder}/meta/info.json is no description of a data set: {error}") from error
    except StopIteration:
        raise TrajectoryError(
            f"{folder} records neither {' nor '.join(VECTOR_COLUMNS)}, so that nothing can be replayed"
        ) from None
    by_episode: dict[int, dict[str, list[Any]]] = {}
    for file in sorted((folder / "data").glob("chunk-*/file-*.parquet")):
        columns = parquet_columns(file)
        for row, episode in enumerate(columns.get("episode_index", [])):
            kept = by_episode.setdefault(int(episode), {"timestamp": [], key: []})
            kept["timestamp"].append(columns["timestamp"][row])
            kept[key].append(columns[key][row])
    missing = [number for number in episodes if number not in by_episode]
    if missing or not by_episode:
        have = f"0 to {max(by_episode)}" if by_episode else "none"
        raise TrajectoryError(f"{folder} has no episode {', '.join(map(str, missing))}: it has {have}")
    chosen = list(episodes) or sorted(by_episode)
    return [from_columns(f"{folder} episode {number}", by_episode[number], names) for number in chosen]


def read_rosbag(path: Path) -> Trajectory:
    """Reads the joint states of a recording: of its one topic of that type, or of the busiest.

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
            times, positions = [], []
            for connection, stamp_ns, raw in reader.messages(connections=[busiest]):
                message: Any = reader.deserialize(raw, connection.msgtype)
                names = names or tuple(message.name)
                if tuple(message.name) != names:
                    raise TrajectoryError(f"{path}: {busiest.topic} changes its joints on the way")
                times.append(stamp_ns * 1e-9)
                positions.append(np.asarray(message.position, dtype=np.float64))
    except (AnyReaderError, OSError, ValueError) as error:
        raise TrajectoryError(f"{path} cannot be read as a ROS 2 recording: {error}") from error
    if not times:
        raise TrajectoryError(f"{path}: {busiest.topic} holds no message: record something first")
    start_s = times[0]
    return Trajectory(
        f"{path} {busiest.topic}", names, np.array(times) - start_s, np.array(positions, dtype=np.float64)
    )


def _feature_names(feature: dict[str, Any]) -> list[str]:
    names = feature.get("names") or []
    if isinstance(names, dict):  # {"motors": [...]}, as older data sets write it
        names = next(iter(names.values()), [])
    return [str(name) for name in names]
