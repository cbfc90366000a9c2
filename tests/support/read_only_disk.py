"""Records to a disk that becomes read-only in mid-episode; prints what came of it as JSON.

``unshare --mount`` runs it, so that the disk, an image of ext4, is mounted for this process alone. The kernel
makes the disk read-only as it does after an error of the device: under files that are open.
"""

from __future__ import annotations

import json
import logging
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from joshua.api import RefusedError
from joshua.api.nodes import ServiceFacts
from joshua.features import Feature
from joshua.messages.make import image, joint_state
from joshua.plan import NodeKind, NodeSpec, TopicSpec
from joshua.testing.recording_context import RecordingContext
from joshua_dataset.reader import Dataset
from joshua_dataset.recorder import Recorder
from joshua_dataset.settings import StoreSettings

ARM, TOP = "/arm/joint_states", "/top/image_raw"
FEATURES = (
    Feature.joints("observation.state", ("pan",), topic=ARM),
    Feature.picture("observation.images.top", 48, 64, topic=TOP),
)
TYPES = {ARM: "sensor_msgs/msg/JointState", TOP: "sensor_msgs/msg/Image"}
PICTURE = np.zeros((48, 64, 3), np.uint8)


class Recording:
    """A recorder of an arm and a camera."""

    def __init__(self, folder: Path, form: str) -> None:
        self.folder = folder
        topics = tuple(TopicSpec(name=name, type_name=kind) for name, kind in TYPES.items())
        store = "joshua_dataset.node:DataStore"
        spec = NodeSpec(
            name=f"store_{form}",
            kind=NodeKind.SERVICE,
            behaviour=store,
            implementation=store,
            subscriptions=topics,
        )
        self.context = RecordingContext(spec)
        settings = StoreSettings(folder=str(folder), format=form, fps=20, tasks=("wave",))
        self.recorder = Recorder(self.context, settings, ServiceFacts(features=FEATURES))
        self.recorder.configure()
        self.recorder.activate()

    def feed(self) -> None:
        now_ns = time.time_ns()
        self.context.receive(ARM, joint_state(("pan",), [0.0], at_ns=now_ns))
        self.context.receive(TOP, image(PICTURE, at_ns=now_ns))
        self.context.tick("frames")

    def start(self) -> str:
        """Start an episode, again if the messages became stale meanwhile on a busy machine."""
        while True:
            self.feed()
            try:
                return self.recorder.start()
            except RefusedError as error:
                if "an episode needs every topic" not in str(error):
                    return str(error)

    def came_of_it(self) -> dict[str, Any]:
        refused = self.start()
        status = self.recorder.status()
        self.recorder.deactivate()
        self.context.stop()
        self.recorder.cleanup()
        found = Dataset.read(self.folder)
        (episode,) = found.episode_list()
        pictures = 0
        if found.format != "mcap":
            pictures = sum(1 for _ in found.decoded(episode, "observation.images.top"))
        return {
            "kept": status.kept,
            "phase": status.phase,
            "message": status.message,
            "refused": refused,
            "failures": self.context.failures,
            "length": episode.length,
            "pictures": pictures,
        }


def run_until(recordings: list[Recording], look: Callable[[], object]) -> None:
    deadline_s = time.monotonic() + 30
    while not look():
        assert time.monotonic() < deadline_s, [item.recorder.status() for item in recordings]
        for item in recordings:
            item.feed()
        time.sleep(0.02)


def main() -> None:
    logging.basicConfig(stream=sys.stderr, level=logging.INFO)
    disk, place = sys.argv[1:]
    subprocess.run(["mount", "-o", "loop", disk, place], check=True)
    recordings = {form: Recording(Path(place) / form, form) for form in ("lerobot", "mcap")}
    cells = list(recordings.values())
    for cell in cells:
        cell.start()
    run_until(cells, lambda: all(cell.recorder.status().frames >= 10 for cell in cells))
    for cell in cells:
        cell.recorder.keep()
        cell.start()
    run_until(cells, lambda: all(cell.recorder.status().frames >= 10 for cell in cells))
    subprocess.run(["mount", "-o", "remount,abort", place], check=True)
    run_until(cells, lambda: all(cell.recorder.status().phase == "stopped" for cell in cells))
    json.dump({form: cell.came_of_it() for form, cell in recordings.items()}, sys.stdout)


if __name__ == "__main__":
    main()
