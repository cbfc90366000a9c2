"""Data sets that others wrote: pictures in tables, and files that are malformed on purpose."""

from __future__ import annotations

import contextlib
import json
import random
import shutil
import struct
import zlib
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from joshua.features import EpisodeError
from joshua_dataset import meta_files, reader
from joshua_dataset.checking import check
from joshua_dataset.commands.dataset import description
from joshua_dataset.metadata import INFO, STATS
from joshua_dataset.pictures import encoded
from joshua_dataset.reader import Dataset, DatasetError
from joshua_dataset.recomputing import recomputed
from joshua_dataset.repair import repair
from joshua_dataset.transform import Source, build
from small_dataset import TOP, write

SIDE = "observation.images.side"
TABLE = Path("data/chunk-000/file-000.parquet")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole") / "set"
    write(folder)
    return folder


@pytest.fixture
def copy(whole: Path, tmp_path: Path) -> Path:
    shutil.copytree(whole, tmp_path / "set")
    return tmp_path / "set"


def rewritten(folder: Path, path: Path, change: Any) -> None:
    (folder / path).write_text(json.dumps(change(json.loads((folder / path).read_text()))))


def with_tables(folder: Path, key: str, pictures: list[bytes]) -> None:
    """Puts pictures into the tables, as LeRobot does for its features of dtype image."""

    def described(info: dict[str, Any]) -> dict[str, Any]:
        info.pop("joshua")
        shape = [24, 32, 3]
        feature = {"dtype": "image", "shape": shape, "names": ["height", "width", "channels"]}
        return info | {"features": info["features"] | {key: feature}}

    rewritten(folder, INFO, described)
    kind = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
    first = 0
    for path in sorted(folder.glob("data/**/*.parquet")):
        table = pq.read_table(path)
        values = [
            {"bytes": data, "path": f"frame-{i}.png"} for i, data in enumerate(pictures[first:][: len(table)])
        ]
        first += len(table)
        pq.write_table(table.append_column(key, pa.array(values, kind)), path)


def picture(number: int) -> bytes:
    return encoded(np.full((24, 32, 3), 20 * number, np.uint8), png=True)


def test_pictures_in_tables_are_read_checked_and_converted(copy: Path, tmp_path: Path) -> None:
    with_tables(copy, TOP, [picture(number) for number in (0, 1, 2, 0, 1)])
    shutil.rmtree(copy / "videos")
    found = Dataset.read(copy)
    assert found.pictures == "table"
    episodes = list(found.episode_list())
    assert [[int(p.mean()) for p in found.decoded(e, TOP)] for e in episodes] == [[0, 20, 40], [0, 20]]
    assert [str(problem) for problem in check(copy, workers=1)] == []
    assert recomputed(copy, workers=1)[TOP]["max"].ravel() == pytest.approx([0.0] * 3, abs=0.2)
    build([Source(copy)], tmp_path / "video", workers=1)
    there = Dataset.read(tmp_path / "video")
    assert there.pictures == "video"
    (first, _) = there.episode_list()
    assert [round(p.mean()) for p in there.decoded(first, TOP)] == pytest.approx([0, 20, 40], abs=3)


def test_frozen_and_missing_pictures_in_tables_are_found(copy: Path) -> None:
    with_tables(copy, TOP, [picture(1)] * 5)
    rewritten(copy, INFO, lambda info: info | {"fps": 1})
    assert any("every picture is the same" in str(problem) for problem in check(copy, workers=1))
    table = pq.read_table(copy / TABLE)
    pq.write_table(table.drop_columns([TOP]), copy / TABLE)
    assert any(f"episode 0: {TOP}: picture 0 cannot be decoded" in str(p) for p in check(copy, workers=1))


def test_one_camera_in_tables_and_one_in_videos(copy: Path, tmp_path: Path) -> None:
    with_tables(copy, SIDE, [picture(number) for number in (5, 6, 7, 8, 9)])
    found = Dataset.read(copy)
    (first, _) = found.episode_list()
    assert [round(p.mean()) for p in found.decoded(first, SIDE)] == [100, 120, 140]
    assert [round(p.mean()) for p in found.decoded(first, TOP)] == pytest.approx([0, 20, 40], abs=3)
    build([Source(copy)], tmp_path / "video", workers=1)
    assert len(list(Dataset.read(tmp_path / "video").features.pictures)) == 2


def bomb(width: int, height: int) -> bytes:
    """A PNG file of some bytes that claims any size."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(bytes(1 << 20))) + chunk(b"IEND", b"")


@pytest.mark.parametrize(
    ("side", "expected"),
    [
        (9000, "has pictures of 9000 x 9000, and 32 x 24"),
        (60000, "has pictures of no size, or too large a one"),
    ],
)
def test_a_picture_that_claims_a_huge_size_is_not_decoded(copy: Path, side: int, expected: str) -> None:
    with_tables(copy, TOP, [bomb(side, side)] * 5)
    found = Dataset.read(copy)
    (first, _) = found.episode_list()
    with pytest.raises(DatasetError, match=expected):
        list(found.decoded(first, TOP))


def test_a_described_size_beyond_reason_is_refused(copy: Path) -> None:
    def huge(info: dict[str, Any]) -> dict[str, Any]:
        info["features"][TOP]["shape"] = [90000, 90000, 3]
        return info

    rewritten(copy, INFO, huge)
    found = Dataset.read(copy)
    with pytest.raises(DatasetError, match="pictures of 90000 x 90000, which are too large to decode"):
        list(found.decoded(next(found.episode_list()), TOP))


def test_a_video_that_changes_its_size_is_refused(copy: Path, tmp_path: Path) -> None:
    import av

    path = copy / f"videos/{TOP}/chunk-000/file-000.mp4"
    container = av.open(str(path.with_suffix(".mkv")), "w", format="matroska")
    stream: Any = container.add_stream("mjpeg", rate=10)
    stream.width, stream.height, stream.pix_fmt = 32, 24, "yuvj420p"
    for number, (width, height) in enumerate(((32, 24), (640, 480), (32, 24))):
        packet: Any = av.Packet(encoded(np.zeros((height, width, 3), np.uint8), png=False))
        packet.stream, packet.pts, packet.dts, packet.is_keyframe = stream, number, number, True
        packet.time_base = Fraction(1, 10)
        container.mux(packet)
    container.close()
    path.with_suffix(".mkv").rename(path)
    found = Dataset.read(copy)
    with pytest.raises(DatasetError):
        assert all(picture.shape == (24, 32, 3) for picture in found.decoded(next(found.episode_list()), TOP))


def test_a_table_that_is_larger_than_any_recording_is_refused(
    copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reader, "MOST_ROWS", 2)
    found = Dataset.read(copy)
    with pytest.raises(DatasetError, match=r"file-000\.parquet has 3 rows; at most 2 are read"):
        found.columns(next(found.episode_list()))


def test_a_line_without_an_end_is_refused(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(meta_files, "LARGEST_LINE", 1 << 20)
    (copy / "meta/tasks.jsonl").write_text('{"task": "' + "a" * (2 << 20))
    rewritten(copy, INFO, lambda info: info | {"codebase_version": "v2.1"})
    with pytest.raises(DatasetError, match=r"tasks\.jsonl has a line above 1 MB"):
        Dataset.read(copy)


ODD: tuple[Any, ...] = (
    *(None, -1, 0, 1e308, 2**70, "", "../../etc", "{chunk_index}"),
    *([], {}, [[1]], True, "NaN", float("nan")),
)


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every place in a JSON value."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*path, key)
        yield from places(inner, (*path, key))


def use_everything(folder: Path, target: Path) -> None:
    """Every tool on a data set; whatever is wrong is said, and nothing else is raised."""
    for work in (
        lambda: Dataset.read(folder).statistics(),
        lambda: list(check(folder, workers=1)),
        lambda: recomputed(folder, workers=1),
        lambda: build([Source(folder)], target, workers=1),
        lambda: repair(folder),
    ):
        with contextlib.suppress(DatasetError, EpisodeError):
            work()


@pytest.mark.parametrize("seed", range(20))
def test_odd_values_in_metadata_are_said(copy: Path, tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    path = chance.choice((INFO, INFO, STATS))
    value = json.loads((copy / path).read_text())
    for _ in range(chance.randrange(1, 3)):
        *inner, last = chance.choice(list(places(value)))
        at = value
        for key in inner:
            at = at[key]
        with contextlib.suppress(TypeError, KeyError, IndexError):  # an odd value took its place before
            at[last] = chance.choice(ODD)
    (copy / path).write_text(json.dumps(value))
    use_everything(copy, tmp_path / "target")


@pytest.mark.parametrize("seed", range(20))
def test_odd_columns_in_tables_are_said(copy: Path, tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    path = chance.choice(sorted(copy.rglob("*.parquet")))
    table = pq.read_table(path)
    name = chance.choice(table.column_names)
    at, count = table.column_names.index(name), len(table)
    odd = chance.choice(
        (
            pa.nulls(count),
            pa.array(["text"] * count),
            pa.array([-(2**40)] * count),
            pa.array([float("nan")] * count),
            pa.array([[1.0, 2.0, 3.0]] * count),
            pa.array([list(range(i)) for i in range(count)]),
            pa.array([{"bytes": b"", "path": None}] * count),
        )
    )
    changed = table.drop_columns([name]) if chance.random() < 0.2 else table.set_column(at, name, odd)
    pq.write_table(changed.replace_schema_metadata(None), path)
    use_everything(copy, tmp_path / "target")


POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"


@pytest.mark.parametrize("name", [f"videos/{TOP}/chunk-000/file-000.mp4", str(TABLE), str(STATS)])
def test_git_lfs_pointers_are_named(copy: Path, tmp_path: Path, name: str) -> None:
    (copy / name).write_text(POINTER)
    expected = (
        f"{copy / name} is a Git LFS pointer: the repository was cloned without its large files. Run git"
    )
    assert any(expected in str(problem) for problem in check(copy, workers=1))
    assert expected in description(copy)
    if name != str(STATS):
        with pytest.raises((DatasetError, EpisodeError), match=r"is a Git LFS pointer"):
            build([Source(copy)], tmp_path / "target", workers=1)


def test_deep_json_is_said(copy: Path) -> None:
    (copy / STATS).write_text("[" * 20_000 + "]" * 20_000)
    with pytest.raises(DatasetError, match="it is nested more than 100 levels deep"):
        Dataset.read(copy).statistics()
