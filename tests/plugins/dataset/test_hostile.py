"""Data sets that nobody here made: no description and no link in one makes a command touch anything else."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import hostile
import pytest
import small_dataset
from joshua.features import EpisodeError
from joshua_dataset import page, recomputing, transform
from joshua_dataset.checking import check
from joshua_dataset.formats import writer_of
from joshua_dataset.reader import Dataset, DatasetError
from joshua_dataset.repair import repair

Edit = Callable[[Path], None]

JOURNAL = ".joshua/open/episode.json"
INFO = "meta/info.json"


def _abandoned(folder: Path, kind: str) -> None:
    """Write two episodes and a part of a third, as a killed writer leaves them."""
    layout = small_dataset.layout(folder, pictures="video" if kind == "lerobot" else "png")
    writer = writer_of(kind)(layout)
    writer.open()
    for task in ("wave", "point"):
        small_dataset.add_episode(writer, task)
    for number in range(8):
        writer.add_frame(small_dataset.frame(number, 1000 + number))
    copy = folder.with_name(f"{folder.name}-copy")
    if kind == "mcap":
        writer._bag._file.flush()  # type: ignore[attr-defined]
    else:
        writer._open.finish()
    shutil.copytree(folder, copy, symlinks=True)
    writer.close()
    shutil.rmtree(folder)
    copy.rename(folder)


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Data sets with an unfinished episode, by format."""
    folder = tmp_path_factory.mktemp("originals")
    kinds = ("lerobot", "parquet", "mcap")
    for kind in kinds:
        _abandoned(folder / kind, kind)
    return {kind: folder / kind for kind in kinds}


class Place:
    """A data set among files that are none of its business.

    Attributes:
        folder: of the data set; victim: the other files.
    """

    def __init__(self, root: Path, original: Path) -> None:
        self.root, self.original = root, original
        self.folder, self.victim = root / "sets/set", root / "victim"
        hostile.fill(self.victim)
        self.folder.parent.mkdir()
        self._others = (self.folder.parent,)
        self.before = hostile.manifest(root, self._others)

    def renew(self, edit: Edit) -> None:
        """Copy the data set, and change the copy."""
        shutil.rmtree(self.folder.parent)
        self.folder.parent.mkdir()
        shutil.copytree(self.original, self.folder, symlinks=True)
        edit(self.folder)

    def check(self) -> None:
        """Check that nothing but data sets has changed."""
        assert hostile.manifest(self.root, self._others) == self.before
        made = {path.name for path in self.folder.parent.iterdir()}
        assert made <= {"set", "target", "page.html", "scratch"}


def _read(folder: Path) -> None:
    dataset = Dataset.read(folder)
    dataset.statistics()
    for episode in dataset.episode_list():
        dataset.columns(episode)
        for feature in dataset.features.pictures:
            for _ in dataset.decoded(episode, feature.key):
                pass


def _finished(folder: Path) -> None:
    """Discard the unfinished episode, with which no command but a repair changes the data set."""
    if not (folder / ".joshua").is_symlink():
        shutil.rmtree(folder / ".joshua/open", ignore_errors=True)


def _delete(folder: Path) -> None:
    _finished(folder)
    transform.delete(folder, [0], workers=1)


def _append(folder: Path) -> None:
    _finished(folder)
    there = Dataset.read(folder)
    writer = writer_of(there.format)(small_dataset.layout(folder, pictures=there.pictures, resume=True))
    writer.open()
    try:
        small_dataset.add_episode(writer, "wave")
    finally:
        writer.close()


def _check(folder: Path) -> None:
    problems = [problem for problem in check(folder, workers=1) if problem.serious]
    if problems:
        raise DatasetError(f"{folder}: {'; '.join(map(str, problems))}")


def _page(folder: Path) -> None:
    scratch = folder.with_name("scratch")
    scratch.mkdir()
    page.write_page(folder, folder.with_name("page.html"), [0, 1], scratch)


OPERATIONS: dict[str, Callable[[Path], object]] = {
    "repair": repair,
    "cut": lambda folder: repair(folder, cut=True),
    "read": _read,
    "check": _check,
    "append": _append,
    "convert": lambda folder: transform.build(
        [transform.Source(folder)], folder.with_name("target"), workers=1
    ),
    "delete": _delete,
    "recompute": lambda folder: recomputing.recomputed(folder, workers=1),
    "page": _page,
}


#: What reads the description of the open episode, and what together reads and writes all files.
REPAIRS = ("repair", "cut")
USUAL = ("repair", "cut", "check", "append", "delete")


def refusals(place: Place, edit: Edit, names: Iterable[str] = tuple(OPERATIONS)) -> dict[str, str]:
    """Try commands on an edited data set; return what each refusal says."""
    found: dict[str, str] = {}
    place.renew(edit)
    for name in names:
        try:
            said = OPERATIONS[name](place.folder)
        except (EpisodeError, DatasetError) as error:
            found[name] = str(error)
        else:
            if "cannot be completed" in str(said):  # the episode is moved aside as it is
                found[name] = str(said)
            place.renew(edit)
    place.check()
    for text in found.values():
        assert all(line.isprintable() for line in text.split("\n")), text
        assert str(place.folder.parent) in text
    return found


def some(place: Place, cases: Mapping[str, str]) -> list[tuple[str, str, tuple[str, ...]]]:
    """Return all cases for one format, and some for the others, because the check is the same.

    Each case comes with the commands that meet it: all of them in some cases, else one that reads.
    """
    step = 1 if place.original.name == "lerobot" else 12
    chosen = list(cases.items())[::step]
    return [
        (what, text, USUAL if number * step % 12 == 0 else ("check",))
        for number, (what, text) in enumerate(chosen)
    ]


def _json(name: str, change: Callable[[Any], None]) -> Edit:
    def edit(folder: Path) -> None:
        record = json.loads((folder / name).read_text())
        change(record)
        (folder / name).write_text(json.dumps(record))

    return edit


def _renamed(name: str, old: str, new: str) -> Edit:
    def change(record: Any) -> None:
        features = record.get("info", record)["features"]
        features[new] = features.pop(old)

    return _json(name, change)


@pytest.fixture(params=("lerobot", "parquet", "mcap"))
def place(request: pytest.FixtureRequest, tmp_path: Path, originals: dict[str, Path]) -> Place:
    return Place(tmp_path, originals[request.param])


def test_an_honest_data_set_is_not_refused(place: Place) -> None:
    found = refusals(place, lambda folder: None)
    if place.original.name == "mcap":  # messages are no frames
        found = {name: found[name] for name in found if name in (*REPAIRS, "check", "append", "delete")}
    assert not found


@pytest.mark.parametrize("key", [small_dataset.TOP, "action"])
def test_names_of_features(place: Place, key: str) -> None:
    for what, name, commands in some(place, hostile.NAMES):
        found = refusals(place, _renamed(JOURNAL, key, name), REPAIRS)
        assert "cannot be a file name" in found.get("repair", ""), (what, found)
        assert "Its files were moved to" in found["repair"]
        assert "cut" not in found, what
        found = refusals(place, _renamed(INFO, key, name), commands)
        assert set(found) == set(commands), what
        assert all("cannot be a file name" in text for text in found.values()), (what, found)


def test_features_that_are_the_same_file_on_some_disks(place: Place) -> None:
    def change(record: Any) -> None:
        features = record.get("info", record)["features"]
        features[small_dataset.TOP.upper()] = features[small_dataset.TOP]

    found = refusals(place, _json(JOURNAL, change), REPAIRS)
    assert "the same file on some disks: rename one of them" in found["repair"]
    found = refusals(place, _json(INFO, change))
    assert all("the same file on some disks" in text for text in found.values())
    assert set(found) == set(OPERATIONS)


@pytest.mark.parametrize("field", ["data_path", "video_path"])
def test_path_templates(place: Place, field: str) -> None:
    if place.original.name == "mcap" and field == "video_path":
        return  # a data set of messages has no video
    for what, template, commands in some(place, hostile.TEMPLATES):

        def change(record: Any, template: str = template) -> None:
            record[field] = template

        found = refusals(place, _json(INFO, change), (*commands, "recompute"))
        assert {"check", "delete", "recompute"} & {*commands, "recompute"} <= set(found), what


def test_values_of_a_wrong_kind(place: Place) -> None:
    record = json.loads((place.original / JOURNAL).read_text())
    outer = [(name,) for name in record]
    inner = [("info", name) for name in ("fps", "robot_type", "features", "joshua")]
    ours = [("info", "joshua", name) for name in record["info"]["joshua"]]
    of_feature = [("info", "features", small_dataset.TOP, name) for name in ("dtype", "shape", "names")]
    values: list[Any] = [None, -1, 1e300, "../../victim", ["../victim"], {"a": "/victim"}]
    for number, path in enumerate((*outer, *inner, *ours, *of_feature)):
        for value in values[number % 3 :: 3]:

            def change(record: Any, path: tuple[str, ...] = path, value: Any = value) -> None:
                for step in path[:-1]:
                    record = record[step]
                record[path[-1]] = value

            found = refusals(place, _json(JOURNAL, change), REPAIRS)
            assert "cut" not in found, (path, value, found)


def _linked(name: str, target: Path | None) -> Edit:
    """Return an edit that puts a symlink, or a pipe without a target, in the place of a file or folder."""

    def edit(folder: Path) -> None:
        path = folder / name
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
        if target is None:
            os.mkfifo(path)
        else:
            path.symlink_to(target)

    return edit


def test_links_and_pipes_at_every_level(place: Place) -> None:
    levels = [path.relative_to(place.original) for path in sorted(place.original.rglob("*"))]
    count = 0
    for level in levels:
        is_folder = (place.original / level).is_dir()
        bait = place.victim / level.name if (place.victim / level.name).exists() else place.victim
        targets = [bait] if is_folder else [bait, (None, Path("/dev/zero"))[count % 2]]
        for target in targets:
            found = refusals(place, _linked(str(level), target), ("check", "repair", OTHERS[count % 3]))
            count += 1
            assert found or level.name in UNREAD, (level, target)
    assert count > 30


#: What reads and writes all files beside a check and a repair.
OTHERS = ("append", "delete", "cut")

#: Files that no command of this test needs.
UNREAD = ("metadata.yaml", "schema.json", "lock", "stats.json")


WRITTEN = (
    *("data/chunk-000/file-002.parquet", "data/chunk-000/episode-002"),
    *("meta/tasks.parquet", "meta/episodes/chunk-000/file-002.parquet", "schema.json"),
    *(".joshua/lock", ".joshua/aside", ".joshua/change", ".joshua/change/new", ".joshua/change/journal.json"),
    *(".joshua/change/.journal.json.part", ".joshua/.transfers.json.part", ".joshua/open/.episode.json.part"),
    *(".joshua/open/whole", f".joshua/open/{small_dataset.TOP}.mp4.whole"),
    *(f".joshua/open/{small_dataset.TOP}.unreadable", f".joshua/open/{small_dataset.TOP}.spare"),
    *(
        f"videos/{small_dataset.TOP}/chunk-000/file-002.mp4",
        f"images/{small_dataset.TOP}/chunk-000/episode-002",
    ),
)


def test_links_in_the_place_of_files_that_are_written(place: Place) -> None:
    """A command that creates a file does not write through a link of its name."""
    targets = (place.victim, place.victim / "not there", place.victim / "thesis.txt")
    for number, name in enumerate(WRITTEN):

        def edit(folder: Path, name: str = name, target: Path = targets[number % 3]) -> None:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.unlink(missing_ok=True)
            path.symlink_to(target)

        refusals(place, edit, USUAL)


def test_repair_keeps_what_it_did_not_write(place: Place) -> None:
    """Files of another program stay, whatever their suffix."""

    def edit(folder: Path) -> None:
        (folder / "data/notes.new").write_text("mine")
        (folder / "data/own").mkdir()
        (folder / "data/own/file-000.new").write_text("mine")
        (folder / "meta/notes.new").write_text("mine")

    for name in REPAIRS:
        place.renew(edit)
        OPERATIONS[name](place.folder)
        for kept in ("data/notes.new", "data/own/file-000.new", "meta/notes.new"):
            assert (place.folder / kept).read_text() == "mine"
