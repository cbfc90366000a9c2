"""Video files and numbered pictures in place of a camera."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from joshua.devices.errors import DeviceError
from joshua_camera.camera import COMPRESSED_IMAGE, OpenCvCamera

Maker = Callable[..., OpenCvCamera]
LEVELS = (10, 60, 110, 160, 210)


def picture(level: int) -> np.ndarray:
    return np.full((240, 320, 3), level, np.uint8)


def write_pictures(folder: Path) -> str:
    for number, level in enumerate(LEVELS):
        cv2.imwrite(str(folder / f"{number:04d}.png"), picture(level))
    return str(folder / "%04d.png")


def write_video(folder: Path, fps: float = 60) -> str:
    path = str(folder / "clip.avi")
    writer = cv2.VideoWriter(path, cv2.VideoWriter.fourcc(*"MJPG"), fps, (320, 240))
    for level in LEVELS:
        writer.write(picture(level))
    writer.release()
    return path


def levels(camera: OpenCvCamera, count: int) -> list[tuple[int, int]]:
    """Numbers of pictures and which of the file's pictures they are."""
    found = []
    for _ in range(count):
        reading = camera.read(30)
        assert reading is not None
        shown = int(reading.data.rgb[120, 160, 0])
        found.append((reading.sequence, min(range(len(LEVELS)), key=lambda i: abs(LEVELS[i] - shown))))
    return found


@pytest.mark.parametrize("write", [write_pictures, write_video])
def test_files_are_played_again_and_again(
    tmp_path: Path, camera_at: Maker, write: Callable[[Path], str]
) -> None:
    camera = camera_at(write(tmp_path), fps=30)
    camera.connect()
    found = levels(camera, 12)
    # in order; pictures that this process was too slow to take are counted
    assert [place for _, place in found] == [number % len(LEVELS) for number, _ in found]


def test_files_keep_the_rate(tmp_path: Path, camera_at: Maker) -> None:
    camera = camera_at(write_pictures(tmp_path), fps=50)
    camera.connect()
    stamps = [reading.stamp_ns for _ in range(25) if (reading := camera.read(30)) is not None]
    sequence_span = camera.figures.received
    assert (stamps[-1] - stamps[0]) / 1e9 >= 0.4
    assert sequence_span >= 25


def test_the_rate_of_the_file_is_compared(tmp_path: Path, camera_at: Maker) -> None:
    path = write_video(tmp_path, fps=25)
    camera = camera_at(path, fps=60)
    camera.connect()
    assert camera.warnings == (f"{path} was recorded at 25 Hz and is played at 60 Hz",)


def test_pictures_are_compressed_when_asked_for(tmp_path: Path, camera_at: Maker) -> None:
    camera = camera_at(write_pictures(tmp_path))
    camera.connect()
    reading = camera.read(30)
    assert reading is not None
    message = camera.message(reading, COMPRESSED_IMAGE, "")
    decoded = cv2.imdecode(message.data, cv2.IMREAD_COLOR)
    assert decoded.shape == (240, 320, 3)


def test_grey_pictures_become_colour(tmp_path: Path, camera_at: Maker) -> None:
    for number in range(2):
        cv2.imwrite(str(tmp_path / f"{number}.png"), np.full((240, 320), 77, np.uint8))
    camera = camera_at(str(tmp_path / "%d.png"))
    camera.connect()
    reading = camera.read(30)
    assert reading is not None
    assert reading.data.rgb.shape == (240, 320, 3)


@pytest.mark.parametrize(("name", "source"), [("film.mp4", "film.mp4"), ("0001.jpg", "%04d.jpg")])
def test_a_git_lfs_pointer_is_named_with_the_command_that_fetches_the_file(
    tmp_path: Path, camera_at: Maker, name: str, source: str
) -> None:
    (tmp_path / ".git").mkdir()
    (tmp_path / name).write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    with pytest.raises(DeviceError) as caught:
        camera_at(str(tmp_path / source)).connect()
    assert f"{tmp_path / name} is a Git LFS pointer" in str(caught.value)
    assert f"run git -C {tmp_path} lfs pull --include {name}" in str(caught.value)


def test_files_that_cannot_be_played(tmp_path: Path, camera_at: Maker) -> None:
    missing = tmp_path / "none.mp4"
    with pytest.raises(DeviceError) as caught:
        camera_at(str(missing)).connect()
    assert str(caught.value) == f"{missing} does not exist: correct the path in source"
    text = tmp_path / "text.mp4"
    text.write_text("no video")
    with pytest.raises(DeviceError) as caught:
        camera_at(str(text)).connect()
    assert str(caught.value).startswith(f"{text} is not a readable video file: convert it")
    pattern = tmp_path / "%04d.jpg"
    with pytest.raises(DeviceError) as caught:
        camera_at(str(pattern)).connect()
    assert str(caught.value).startswith(
        f"{pattern} matches no picture: number the pictures from 0 or 1 without gaps"
    )


def test_pictures_of_another_size(tmp_path: Path, camera_at: Maker) -> None:
    camera = camera_at(write_pictures(tmp_path), width=640, height=480)
    with pytest.raises(DeviceError, match="delivers 320 × 240, and the file asks for 640 × 480"):
        camera.connect()
