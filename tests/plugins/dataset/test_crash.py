"""Kills and power cuts: what has ended stays readable without repair, and a repair completes the rest."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import killed_writer
import pytest
from joshua.features import EpisodeError, Frame
from joshua_dataset import repair as repairing
from joshua_dataset.files import Files
from joshua_dataset.lock import PRIVATE
from joshua_dataset.open_episode import open_folder
from joshua_dataset.reader import Dataset
from joshua_dataset.repair import repair
from joshua_dataset.writer import LeRobotWriter

FPS = killed_writer.FPS


def run_and_kill(folder: Path, frames: int, length: int) -> tuple[int, int]:
    """Kills a writer after some frames; returns what it had said: (episodes, frames of the open one)."""
    command = [sys.executable, killed_writer.__file__, str(folder), str(length)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == "open\n"
        said = (0, 0)
        for _ in range(frames):
            episodes, count = writer.stdout.readline().split()
            said = (int(episodes), int(count))
        writer.kill()
        rest = writer.stdout.read().split("\n")
    complete = [line for line in rest[:-1] if line]
    if complete:
        episodes, count = complete[-1].split()
        said = (int(episodes), int(count))
    return said


def lengths(folder: Path) -> list[int]:
    """Frames of each episode, all of whose parts are read."""
    if not (folder / "meta/info.json").exists():
        return []
    found = Dataset.read(folder)
    result = []
    for episode in found.episode_list():
        columns = found.columns(episode)
        assert columns["frame_index"].tolist() == list(range(episode.length))
        for feature in found.features.pictures:
            assert sum(1 for _ in found.decoded(episode, feature.key)) == episode.length
        result.append(episode.length)
    assert len(result) == found.episodes
    return result


@pytest.mark.parametrize("seed", range(4))
def test_kill_at_any_moment(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    folder, length = tmp_path / "set", chance.choice((7, 40, 1000))
    episodes, count = run_and_kill(folder, chance.randrange(10, 130), length)
    assert lengths(folder)[:episodes] == [length] * episodes
    if (folder / PRIVATE / "open").exists():
        with pytest.raises(EpisodeError, match=r"left unfinished\. Run `joshua dataset repair .*--cut"):
            LeRobotWriter(killed_writer.layout(folder)).open()
        assert repair(folder)
    found = lengths(folder)
    assert found[:episodes] == [length] * episodes
    recovered = sum(found[episodes:])
    assert recovered >= count - FPS, f"{count} frames were recorded and {recovered} recovered"
    after = files(folder)
    if found:
        assert "is complete" in str(repair(folder))
        assert files(folder) == after


def files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if PRIVATE not in path.parts)


def test_cut_discards_the_unfinished_episode(tmp_path: Path) -> None:
    episodes, _ = run_and_kill(tmp_path, 60, 25)
    assert episodes == 2
    said, looked = repair(tmp_path, cut=True).lines
    assert said == "the unfinished episode 2 is discarded; 2 episodes stay"
    assert looked.startswith(f"{tmp_path} is complete: 2 episodes. ")
    assert lengths(tmp_path) == [25, 25]
    assert not open_folder(tmp_path).exists()


def test_repair_needs_a_data_set_without_a_writer(tmp_path: Path) -> None:
    with pytest.raises(EpisodeError, match=r"is not a data set: it has no meta/info\.json"):
        repair(tmp_path)
    writer = LeRobotWriter(killed_writer.layout(tmp_path / "set"))
    writer.open()
    add(writer, 2)
    with pytest.raises(EpisodeError, match=r"is being written by process \d+"):
        repair(tmp_path / "set")
    writer.close()


def test_an_episode_with_a_torn_journal_is_moved_aside(tmp_path: Path) -> None:
    run_and_kill(tmp_path, 40, 25)
    (open_folder(tmp_path) / "episode.json").write_text('{"episode_ind')
    before = {path.name: path.read_bytes() for path in open_folder(tmp_path).iterdir()}
    said = repair(tmp_path).lines[0]
    assert "cannot be completed: it has no valid journal. Its files were moved to " in said
    aside = Path(said.rpartition(" ")[2])
    assert {path.name: path.read_bytes() for path in aside.iterdir()} == before
    assert lengths(tmp_path) == [25]
    assert "is complete: 1 episode" in str(repair(tmp_path))


def end_twice(writer: LeRobotWriter, count: int) -> None:
    writer.end_episode("wave")
    add(writer, count)


def add(writer: LeRobotWriter, count: int) -> None:
    add_frames(writer, count)
    writer.end_episode("wave")


def add_frames(writer: LeRobotWriter, count: int) -> None:
    import numpy as np

    for number in range(count):
        picture = np.full((64, 64, 3), number, np.uint8)
        values: dict[str, Any] = {"observation.state": [number, 0], "action": [number, 1]}
        values |= {killed_writer.TOP: picture, killed_writer.SIDE: picture}
        writer.add_frame(Frame(number, values))


class Disk(Files):
    """Knows after each operation what a power cut would leave: what was brought to the disk."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.contents: dict[int, bytes] = {}
        self.names: dict[Path, dict[str, int]] = {}
        self.cuts = 0
        self.on_cut = lambda: None

    def sync(self, path: Path) -> None:
        super().sync(path)
        if threading.current_thread() is not threading.main_thread():
            return  # of the open episode, beside the steps of a commit
        self.contents[path.stat().st_ino] = path.read_bytes()
        self._cut()

    def sync_folder(self, folder: Path) -> None:
        super().sync_folder(folder)
        if threading.current_thread() is not threading.main_thread():
            return
        self.names[folder] = {entry.name: entry.inode() for entry in os.scandir(folder)}
        self._cut()

    def replace(self, source: Path, target: Path) -> None:
        super().replace(source, target)
        self._cut()

    def _cut(self) -> None:
        self.cuts += 1
        self.on_cut()

    def left(self, target: Path, *, names_lost: bool) -> None:
        """Makes what a cut leaves: contents that were not synced are lost, and names too or not."""
        shutil.rmtree(target, ignore_errors=True)
        self._leave(self.root, target, names_lost)

    def _leave(self, folder: Path, target: Path, names_lost: bool) -> None:
        target.mkdir(parents=True)
        now = {entry.name: entry.inode() for entry in os.scandir(folder)}
        for name, inode in (self.names.get(folder, {}) if names_lost else now).items():
            if name == PRIVATE:
                continue
            if (folder / name).is_dir():
                self._leave(folder / name, target / name, names_lost)
            else:
                (target / name).write_bytes(self.contents.get(inode, b""))


def test_power_cut_at_any_operation(tmp_path: Path) -> None:
    disk = Disk(tmp_path / "set")
    writer = LeRobotWriter(killed_writer.layout(tmp_path / "set"), disk)
    ended = 0

    def look() -> None:
        for names_lost in (True, False):
            disk.left(tmp_path / "left", names_lost=names_lost)
            found = lengths(tmp_path / "left")
            assert found[:ended] == [3] * ended, f"cut {disk.cuts}, names lost: {names_lost}"

    disk.on_cut = look
    writer.open()
    for _ in range(2):
        add(writer, 3)
        ended += 1
    look()
    writer.close()
    assert disk.cuts > 25


@pytest.mark.parametrize("after", range(0, 24, 4))
def test_kill_between_the_steps_of_a_commit(tmp_path: Path, after: int) -> None:
    class Killed(BaseException):
        pass

    class Deadly(Disk):
        def _cut(self) -> None:
            super()._cut()
            if self.cuts == limit:
                raise Killed

    limit = -1
    disk = Deadly(tmp_path / "set")
    writer = LeRobotWriter(killed_writer.layout(tmp_path / "set"), disk)
    writer.open()
    add(writer, 3)
    add_frames(writer, 4)
    limit = disk.cuts + after + 1
    with pytest.raises(Killed):
        end_twice(writer, 4)  # the second one where the first took fewer steps
    writer._lock.release()  # as the kernel does
    before = lengths(tmp_path / "set")
    assert before[0] == 3
    repair(tmp_path / "set")
    found = lengths(tmp_path / "set")
    assert found[: len(before)] == before
    assert found[1:] in ([4], [4, 4])
    assert Dataset.read(tmp_path / "set").statistics()["action"]["count"].tolist() == [sum(found)]
    assert not list((tmp_path / "set").rglob("*.new"))
    assert "is complete" in str(repairing.repair(tmp_path / "set"))
