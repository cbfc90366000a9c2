"""Reading of trajectories in any supported format."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from joshua_mujoco_sim.trajectories.datasets import is_lerobot, is_rosbag, read_lerobot, read_rosbag
from joshua_mujoco_sim.trajectories.tables import read_csv, read_json_lines, read_parquet
from joshua_mujoco_sim.trajectories.trajectory import Budget, Trajectory, TrajectoryError

FORMS = "a .csv, .jsonl or .parquet file, the folder of a LeRobot data set, an .mcap file or a rosbag2 folder"

_TABLES = {".csv": read_csv, ".jsonl": read_json_lines, ".parquet": read_parquet}


def size_bytes(path: Path) -> int:
    """Return the size of a recording, without the videos of a data set."""
    files = [path] if path.is_file() else [file for file in path.rglob("*") if file.suffix != ".mp4"]
    return sum(file.stat().st_size for file in files if file.is_file())


def read_trajectories(path: Path, episodes: Sequence[int] = (), unit: str = "") -> list[Trajectory]:
    """Read a recording.

    Args:
        path: file or folder.
        episodes: of a data set, in replay order; () for all.
        unit: of the positions, a value of ``joshua.features.Unit``; "" for the unit that the recording
            states.

    Raises:
        TrajectoryError: it does not exist, has an unknown format, cannot be read, or is too long.
    """
    found = _read(path, episodes, Budget())
    return [replace(trajectory, unit=unit) for trajectory in found] if unit else found


def _read(path: Path, episodes: Sequence[int], budget: Budget) -> list[Trajectory]:
    if not path.exists():
        raise TrajectoryError(f"{path} does not exist: name {FORMS}")
    if path.is_dir() and is_lerobot(path):
        return read_lerobot(path, episodes, budget)
    if is_rosbag(path):
        return [read_rosbag(path, budget)]
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix in _TABLES)
        if files:
            chosen = [files[number] for number in episodes if number < len(files)] if episodes else files
            if episodes and len(chosen) < len(episodes):
                raise TrajectoryError(
                    f"{path} has {len(files)} episodes, counted from 0, not {max(episodes)}"
                )
            return [trajectory for file in chosen for trajectory in _read(file, (), budget)]
        raise TrajectoryError(f"{path} is a folder without a recording: name {FORMS}")
    read = _TABLES.get(path.suffix)
    if read is None:
        raise TrajectoryError(f"{path}: {path.suffix or 'no suffix'} is not a supported format: name {FORMS}")
    return [read(path, budget)]
