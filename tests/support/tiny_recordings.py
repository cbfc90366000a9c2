"""Small data sets of an arm with six joints and two cameras, which a policy can learn from."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
from joshua.features import DatasetLayout, Feature, FeatureSet, Frame
from joshua_dataset.writer import LeRobotWriter

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
FPS = 10


def write_recording(
    folder: Path,
    *,
    lengths: tuple[int, ...] = (12, 9, 11),
    cameras: tuple[str, ...] = ("top", "wrist"),
    width: int = 64,
    height: int = 48,
    joints: tuple[str, ...] = JOINTS,
    codec: str = "h264",
    arms: tuple[str, ...] = (),
    fps: int = FPS,
) -> Path:
    """Writes episodes in which a square stands where the joints are, and the action is where they go.

    Each of several arms is a quarter of a turn ahead of the one before it.
    """
    keys = [f"observation.images.{name}" for name in cameras]
    ends = [f".{arm}" for arm in arms] or [""]
    features = FeatureSet(
        [
            *(Feature.joints(f"observation.state{end}", joints) for end in ends),
            *(Feature.joints(f"action{end}", joints) for end in ends),
            *(Feature.picture(key, height, width) for key in keys),
        ]
    )
    layout = DatasetLayout(folder, "SO-ARM100", fps, features, codec=codec)
    with contextlib.closing(LeRobotWriter(layout)) as writer:
        writer.open()
        for episode, length in enumerate(lengths):
            for number in range(length):
                values: dict[str, Any] = {}
                for turn, end in enumerate(ends):
                    angles = episode + np.arange(len(joints)) + turn * np.pi / 2
                    values[f"observation.state{end}"] = np.sin(0.3 * number + angles).astype(np.float32)
                    values[f"action{end}"] = np.sin(0.3 * (number + 1) + angles).astype(np.float32)
                state = values[f"observation.state{ends[0]}"]
                for index, key in enumerate(keys):
                    picture = np.full((height, width, 3), 40 * index, np.uint8)
                    at = int((width - 12) * (state[index] + 1) / 2)
                    picture[8:20, at : at + 12] = (220, 180, 20 * (episode % 8))
                    values[key] = picture
                writer.add_frame(Frame(1_000_000_000 + number * 1_000_000_000 // fps, values))
            writer.end_episode("wave" if episode % 2 else "point")
    return folder
