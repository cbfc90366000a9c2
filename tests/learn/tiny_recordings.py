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
) -> Path:
    """Writes episodes in which a square stands where the joints are, and the action is where they go."""
    keys = [f"observation.images.{name}" for name in cameras]
    features = FeatureSet(
        [
            Feature.joints("observation.state", joints),
            Feature.joints("action", joints),
            *(Feature.picture(key, height, width) for key in keys),
        ]
    )
    layout = DatasetLayout(folder, "SO-ARM100", FPS, features, codec=codec)
    with contextlib.closing(LeRobotWriter(layout)) as writer:
        writer.open()
        for episode, length in enumerate(lengths):
            for number in range(length):
                state = np.sin(0.3 * number + episode + np.arange(len(joints))).astype(np.float32)
                after = np.sin(0.3 * (number + 1) + episode + np.arange(len(joints))).astype(np.float32)
                values: dict[str, Any] = {"observation.state": state, "action": after}
                for index, key in enumerate(keys):
                    picture = np.full((height, width, 3), 40 * index, np.uint8)
                    at = int((width - 12) * (state[index] + 1) / 2)
                    picture[8:20, at : at + 12] = (220, 180, 20 * (episode % 8))
                    values[key] = picture
                writer.add_frame(Frame(1_000_000_000 + number * 100_000_000, values))
            writer.end_episode("wave" if episode % 2 else "point")
    return folder
