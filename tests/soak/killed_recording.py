"""Kills a writer of data sets at random moments: no episode is unreadable, and at most a second is lost.

Each kill is followed by what a user does: the data set is read as it is, every picture decoded, then
repaired, and read again. Ends with 1 where an episode could not be read, or more was lost.
Run: python tests/soak/killed_recording.py [KILLS] [SEED]
"""

from __future__ import annotations

import multiprocessing
import os
import random
import signal
import sys
import tempfile
import time
from multiprocessing.connection import Connection
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "support"))

import killed_writer
from joshua_dataset.lock import PRIVATE
from joshua_dataset.reader import Dataset, DatasetError
from joshua_dataset.repair import repair

KILLS = 200
LONGEST_S = 1.8
LENGTHS = (5, 20, 60, 1000)


def child(folder: str, length: int, said: Connection) -> None:
    """Record until the kill."""
    killed_writer.record(Path(folder), length, said.send)


def readable(folder: Path) -> list[int]:
    """Frames of each episode, all of whose parts are decoded. Raises DatasetError."""
    if not (folder / "meta/info.json").exists():
        return []
    found = Dataset.read(folder)
    lengths = []
    for episode in found.episode_list():
        columns = found.columns(episode)
        for feature in found.features.pictures:
            count = sum(1 for _ in found.decoded(episode, feature.key))
            if count != episode.length or len(columns["index"]) != count:
                raise DatasetError(f"episode {episode.index} has {count} pictures of {episode.length}")
        lengths.append(episode.length)
    return lengths


def kill_once(folder: Path, chance: random.Random) -> float:
    """Kill a writer; return the lost seconds. Raises DatasetError and AssertionError."""
    context = multiprocessing.get_context("forkserver")
    ours, theirs = context.Pipe(duplex=False)
    length = chance.choice(LENGTHS)
    writer = context.Process(target=child, args=(str(folder), length, theirs))
    writer.start()
    theirs.close()
    assert ours.recv() == "open"
    time.sleep(chance.uniform(0.0, LONGEST_S))
    assert writer.pid is not None
    os.kill(writer.pid, signal.SIGKILL)
    writer.join()
    said = "0 0"
    try:
        while True:
            said = ours.recv()
    except EOFError:
        pass
    episodes, count = map(int, said.split())
    before = readable(folder)
    assert before[:episodes] == [length] * episodes, f"{episodes} episodes had ended, there are {before}"
    if (folder / PRIVATE / "open").exists():
        repair(folder)
    after = readable(folder)
    assert after[: len(before)] == before, f"the repair changed {before} to {after}"
    return (episodes * length + count - sum(after)) / killed_writer.FPS


def main() -> int:
    """Run, and print what became of the recordings."""
    kills = int(sys.argv[1]) if len(sys.argv) > 1 else KILLS
    chance = random.Random(int(sys.argv[2]) if len(sys.argv) > 2 else time.time_ns())
    multiprocessing.get_context("forkserver").set_forkserver_preload(["killed_writer"])
    lost: list[float] = []
    failures = 0
    for number in range(kills):
        with tempfile.TemporaryDirectory() as name:
            try:
                lost.append(kill_once(Path(name) / "set", chance))
            except (DatasetError, AssertionError) as error:
                failures += 1
                print(f"kill {number}: {error}", flush=True)
    lost.sort()
    largest, median = (lost[-1], lost[len(lost) // 2]) if lost else (0.0, 0.0)
    print(f"{kills} kills: {failures} unreadable; lost {median:.2f} s (median), {largest:.2f} s (largest)")
    return int(bool(failures) or largest > 1.0)


if __name__ == "__main__":
    sys.exit(main())
