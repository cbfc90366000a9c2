"""Relative paths of input files start at the file that names them."""

from __future__ import annotations

from pathlib import Path

from joshua.config.input_paths import with_absolute_paths
from joshua.plan import Position
from joshua.schema import config_pb2 as pb
from joshua.textproto.positions import Positions

BLOCK = "robot.perceptions[0].camera_config"


class KnownPositions(Positions):
    def __init__(self, **files: Path) -> None:
        super().__init__()
        self.files = {f"{BLOCK}.{name}": file for name, file in files.items()}

    def value(self, field_path: str) -> Position | None:
        file = self.files.get(field_path)
        return Position(file=str(file), line=1, column=1) if file else None


def test_a_relative_path_starts_at_the_file_that_names_it(tmp_path: Path) -> None:
    included = tmp_path / "parts" / "camera.pbtxt"
    included.parent.mkdir()
    included.touch()
    main = tmp_path / "robot.pbtxt"
    block = pb.CameraConfig(source="../clips/%04d.jpg", intrinsics_file="top.yaml", width=640)
    found = with_absolute_paths(block, BLOCK, KnownPositions(source=included), str(main))
    assert found.source == str(tmp_path / "clips" / "%04d.jpg")
    assert found.intrinsics_file == str(tmp_path / "top.yaml")  # from --set: no position, so the main file
    assert found.width == 640
    assert block.source == "../clips/%04d.jpg"


def test_what_is_no_relative_path_stays(tmp_path: Path) -> None:
    main = str(tmp_path / "robot.pbtxt")
    for source in ("/dev/video2", "usb-046d_Cam_1-video-index0", "http://phone/video", "/srv/clip.mp4"):
        block = pb.CameraConfig(source=source, pixel_format="MJPG")
        assert with_absolute_paths(block, BLOCK, KnownPositions(), main) is block


def test_the_home_folder_is_known() -> None:
    block = pb.CameraConfig(intrinsics_file="~/top.yaml")
    found = with_absolute_paths(block, BLOCK, KnownPositions(), "robot.pbtxt")
    assert found.intrinsics_file == str(Path("~/top.yaml").expanduser())
