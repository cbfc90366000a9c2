"""Pictures and numbers of data sets: what cannot be learned from is named, and nothing temporary stays."""

from __future__ import annotations

import errno
import json
import os
import shutil
import tempfile
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import remotes
from joshua_dataset.cloud import bucket
from joshua_dataset.cloud.copies import store_of
from joshua_dataset.cloud.store import Tally
from joshua_dataset.cloud.upload import upload
from joshua_imitation import stream as streams
from joshua_imitation.data import Recording, open_dataset
from joshua_imitation.pictures import Album
from joshua_training.run_folder import RunError
from tiny_recordings import write_recording

TOP = "observation.images.top"


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(
        tmp_path_factory.mktemp("recording") / "set", cameras=("top",), width=32, height=32
    )


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def left(place: Path) -> list[str]:
    return [path.name for path in place.iterdir() if path.name.startswith(("joshua-", ".joshua-"))]


def copied(recording: Path, folder: Path, **values: Any) -> Path:
    """A copy with other metadata."""
    shutil.copytree(recording, folder)
    path = folder / "meta" / "info.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | values))
    return folder


def with_images(recording: Path, folder: Path) -> Path:
    """A copy with pictures in its table, as LeRobot writes them without videos: 0, 1, 2, …"""
    copied(recording, folder)
    path = folder / "meta" / "info.json"
    info = json.loads(path.read_text())
    info["features"][TOP]["dtype"] = "image"
    del info["joshua"]
    path.write_text(json.dumps(info))
    codec: Any = av.CodecContext.create("png", "w")
    codec.width = codec.height = 32
    codec.pix_fmt, codec.time_base = "rgb24", Fraction(1, 10)
    number = 0
    for table in sorted((folder / "data").rglob("*.parquet")):
        rows, pictures = pq.read_table(table), []
        for _ in range(rows.num_rows):
            frame = av.VideoFrame.from_ndarray(np.full((32, 32, 3), number, np.uint8), format="rgb24")
            pictures.append({"bytes": b"".join(map(bytes, codec.encode(frame))), "path": f"{number}.png"})
            number += 1
        pq.write_table(rows.append_column(TOP, pa.array(pictures)), table)
    return folder


def read(folder: Path) -> Recording:
    dataset, _ = open_dataset(str(folder))
    return Recording(dataset)


def test_decoded_pictures_are_removed_at_the_end(recording: Path, place: Path) -> None:
    album = Album(read(recording), None, 100)
    assert album.fill(lambda count: True)
    (folder,) = left(place)
    assert folder.startswith("joshua-pictures-")
    other = Album(read(recording), None, 100, album.shared)
    assert (other.get(TOP, np.arange(3)) == album.get(TOP, np.arange(3))).all()
    other.close()
    assert left(place) == [folder]
    album.close()
    assert left(place) == []


def test_a_data_set_without_episodes_is_named(recording: Path, tmp_path: Path) -> None:
    uncounted = copied(recording, tmp_path / "uncounted", total_episodes=0, total_frames=0)
    with pytest.raises(RunError, match="counts 0 episodes, and meta/episodes has 3"):
        read(uncounted)
    for name in ("data", "videos", "meta/episodes", "meta/tasks.parquet", "meta/stats.json"):
        path = uncounted / name
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    with pytest.raises(RunError, match="uncounted has no episode to learn from: record some"):
        read(uncounted)


def test_a_video_that_ends_early_is_named(recording: Path, tmp_path: Path) -> None:
    short = write_recording(tmp_path / "short", cameras=("top",), width=32, height=32, lengths=(12, 9, 5))
    copy = copied(recording, tmp_path / "copy")
    for video in (short / "videos").rglob("*.mp4"):
        shutil.copy(video, copy / video.relative_to(short))
    with pytest.raises(RunError, match=f"{copy} cannot be learned from: .*5 pictures, and 11 are described"):
        open_dataset(str(copy))
    dataset, _ = open_dataset(str(copy), checks=False)  # as of a stream, whose videos come later
    album = Album(Recording(dataset), None, 100)
    said = f"{copy} has 32 frames, but 26 pictures of {TOP}: run `joshua dataset check {copy}`"
    with pytest.raises(RunError, match=said):
        album.fill(lambda count: True)
    album.close()


def test_pictures_in_tables_are_decoded_at_once_or_not_at_all(
    recording: Path, tmp_path: Path, place: Path
) -> None:
    found = read(with_images(recording, tmp_path / "images"))
    said = (
        "the pictures take 1 MB decoded, and only those of videos can be decoded while they are read: set pic"
    )
    with pytest.raises(RunError, match=said):
        Album(found, None, 0)
    assert left(place) == []
    album = Album(found, None, 1)
    assert album.fill(lambda count: True)
    assert (album.get(TOP, np.array([7, 20])).mean(axis=(1, 2, 3)) == [7, 20]).all()
    album.close()


def test_a_stream_that_cannot_be_learned_from_is_named(
    recording: Path, tmp_path: Path, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    torn = copied(recording, tmp_path / "torn")
    for video in (torn / "videos").rglob("*.mp4"):
        video.unlink()
    images = with_images(recording, tmp_path / "images")
    with remotes.KINDS["s3"]() as remote:
        remotes.use(remote, monkeypatch)

        def streamed(folder: Path) -> Album:
            address = f"{remote.url}/{folder.name}"
            upload(folder, store_of(address), Tally())
            dataset, stream = open_dataset(address)
            assert stream is not None
            assert [name for name in left(place) if name.startswith("joshua-stream-")] == [
                stream.folder.parent.name
            ]
            try:
                return Album(Recording(dataset, stream=stream), None, 0)
            except RunError:
                stream.close()
                raise

        album = streamed(torn)
        with pytest.raises(
            RunError, match=r"/torn has no videos/.*, which its metadata name: upload the data"
        ):
            album.get(TOP, np.array([0]))
        album.close()
        with pytest.raises(
            RunError, match=r"/images has pictures outside videos, .*`joshua dataset download`"
        ):
            streamed(images)
        with pytest.raises(RunError, match=r"layout v3\.0, csv: run `joshua dataset convert"):
            streamed(copied(recording, tmp_path / "csv", joshua={"format": "csv", "pictures": "video"}))
    assert left(place) == []


def test_a_stream_is_transferred_once_for_all_epochs_and_processes(
    recording: Path, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (bucket, streams):
        monkeypatch.setattr(module, "CHUNK", 1024)
    size = sum(video.stat().st_size for video in recording.rglob("*.mp4"))
    assert size > 3 * 1024
    frames = np.concatenate([np.random.default_rng(epoch).permutation(32) for epoch in range(2)])
    local = Album(read(recording), None, 0)
    with remotes.KINDS["s3"]() as remote:
        remotes.use(remote, monkeypatch)
        upload(recording, store_of(f"{remote.url}/set"), Tally())
        moved: list[int] = []

        def streamed(shared: Path | None = None) -> Album:
            dataset, stream = open_dataset(f"{remote.url}/set", shared)
            assert stream is not None
            chunks = stream._store.chunks

            def counted(there: Any, start: int) -> Any:
                for chunk in chunks(there, start):
                    moved.append(len(chunk))
                    yield chunk

            monkeypatch.setattr(stream._store, "chunks", counted)
            return Album(Recording(dataset, stream=stream), None, 0, shared)

        album = streamed()
        other = streamed(album.shared)  # as another process of the training does
        with ThreadPoolExecutor(4) as threads:
            batches = [(source, batch) for batch in frames.reshape(-1, 4) for source in (album, other)]
            found = list(threads.map(lambda pair: pair[0].get(TOP, pair[1]), batches))
        for one in (found[::2], found[1::2]):
            assert (np.concatenate(one) == local.get(TOP, frames)).all()
        assert sum(moved) <= 1.1 * size
        other.close()
        assert album.shared is not None
        assert any(album.shared.iterdir())
        album.close()
    assert left(place) == []


def test_a_disk_without_room_for_the_videos_is_named(
    recording: Path, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with remotes.KINDS["s3"]() as remote:
        remotes.use(remote, monkeypatch)
        address = f"{remote.url}/set"
        upload(recording, store_of(address), Tally())
        dataset, stream = open_dataset(address)
        found = Recording(dataset, stream=stream)
        used = shutil.disk_usage(place)
        with monkeypatch.context() as full:
            full.setattr(shutil, "disk_usage", lambda _: used._replace(free=60 << 20))
            said = rf"videos of {address} take 1 MB, .* has 60 MB free, of which .*: free 5 MB there, or"
            with pytest.raises(RunError, match=said):
                Album(found, None, 0)
        assert left(place) == []
        dataset, stream = open_dataset(address)
        album = Album(Recording(dataset, stream=stream), None, 0)

        def refuse(*_: Any) -> None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        with monkeypatch.context() as full:
            full.setattr(Path, "replace", refuse)
            said = r"No space left on device: free some space, or set TMPDIR .*, and continue with resume_run"
            with pytest.raises(RunError, match=said):
                album.get(TOP, np.array([0]))
        album.close()
    assert left(place) == []
