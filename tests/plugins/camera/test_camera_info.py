"""Intrinsics: files of the calibrator, and what is wrong with others."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.devices.errors import DeviceError
from joshua.messages import decode, encode
from joshua.messages.make import header
from joshua_camera.camera_info import camera_info, load_intrinsics, uncalibrated

CALIBRATION = """
image_width: 320
image_height: 240
camera_name: top
camera_matrix:
  rows: 3
  cols: 3
  data: [300.5, 0, 160, 0, 301.5, 120, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, -0.2, 0.001, 0.002, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [290.5, 0, 161, 0, 0, 291.5, 121, 0, 0, 0, 1, 0]
"""


def write(folder: Path, text: str) -> str:
    path = folder / "camera.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_a_calibration_becomes_a_message(tmp_path: Path) -> None:
    intrinsics = load_intrinsics(write(tmp_path, CALIBRATION), 320, 240)
    message = camera_info(intrinsics, header("camera_top", 1_500_000_000))
    again = decode("sensor_msgs/msg/CameraInfo", encode(message))
    assert (again.width, again.height, again.distortion_model) == (320, 240, "plumb_bob")
    assert list(again.k) == [300.5, 0, 160, 0, 301.5, 120, 0, 0, 1]
    assert list(again.d) == [0.1, -0.2, 0.001, 0.002, 0.0]
    assert list(again.p) == [290.5, 0, 161, 0, 0, 291.5, 121, 0, 0, 0, 1, 0]
    assert again.header.frame_id == "camera_top"
    assert again.header.stamp.nanosec == 500_000_000


def test_without_rectification_the_camera_is_taken_as_it_is(tmp_path: Path) -> None:
    text = CALIBRATION[: CALIBRATION.index("rectification_matrix")]
    intrinsics = load_intrinsics(write(tmp_path, text), 320, 240)
    assert intrinsics.rectification == (1, 0, 0, 0, 1, 0, 0, 0, 1)
    assert intrinsics.projection == (300.5, 0, 160, 0, 0, 301.5, 120, 0, 0, 0, 1, 0)


def test_an_uncalibrated_camera_says_so_by_zeros() -> None:
    message = camera_info(uncalibrated(640, 480), header("", 0))
    encode(message)
    assert message.k[0] == 0.0
    assert (message.width, message.height) == (640, 480)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is not a camera calibration (content: Input should be"),
        ("[1, 2]", "is not a camera calibration"),
        ("image_width: 320", "image_height: Field required"),
        ("a: [", "is not valid YAML"),
        ("!!python/object/apply:os.system ['true']", "is not valid YAML"),
        (CALIBRATION.replace("image_width: 320", "image_width: 640"), "was calibrated at 640 × 240"),
        (CALIBRATION.replace("300.5", ".nan"), "every number must be finite"),
        (CALIBRATION.replace("[300.5, 0, 160, ", "[300.5, "), "camera_matrix has 3 × 3 with 7 numbers"),
        (CALIBRATION.replace("cols: 4", "cols: 3"), "projection_matrix has 3 × 3"),
        ("x" * 1_100_000, "is too large for a calibration"),
    ],
)
def test_what_is_no_calibration(tmp_path: Path, text: str, message: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(DeviceError) as caught:
        load_intrinsics(path, 320, 240)
    assert message in str(caught.value)
    assert path in str(caught.value)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(
        DeviceError, match=r"cannot be read \(no such file or directory\): correct intrinsics"
    ):
        load_intrinsics(str(tmp_path / "none.yaml"), 320, 240)
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(DeviceError, match="is not a text file"):
        load_intrinsics(str(tmp_path / "binary.yaml"), 320, 240)
