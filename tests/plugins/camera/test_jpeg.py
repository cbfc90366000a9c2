"""Whole and damaged JPEG pictures, told apart without decoding."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from joshua_camera.jpeg import JpegFacts, inspect_jpeg

NOISE = np.random.default_rng(0).integers(0, 255, (48, 64, 3)).astype(np.uint8)


def encode(*options: int) -> bytes:
    return cv2.imencode(".jpg", NOISE, list(options))[1].tobytes()


@pytest.mark.parametrize(
    "options",
    [
        (),
        (cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
        (cv2.IMWRITE_JPEG_RST_INTERVAL, 1),
        (cv2.IMWRITE_JPEG_OPTIMIZE, 1),
    ],
)
def test_a_whole_picture(options: tuple[int, ...]) -> None:
    data = encode(*options)
    assert inspect_jpeg(data) == JpegFacts(64, 48, len(data))


def test_padding_after_the_picture_is_not_part_of_it() -> None:
    data = encode()
    assert inspect_jpeg(data + b"\0" * 100) == JpegFacts(64, 48, len(data))
    assert inspect_jpeg(data + data) == JpegFacts(64, 48, len(data))


def test_fill_bytes_between_segments() -> None:
    data = encode()
    assert inspect_jpeg(data[:2] + b"\xff\xff" + data[2:]) == JpegFacts(64, 48, len(data) + 2)


def test_every_cut_shows() -> None:
    data = encode()
    assert all(inspect_jpeg(data[:length]) is None for length in range(len(data)))


def test_a_stray_marker_in_the_scan_shows() -> None:
    data = bytearray(encode())
    middle = len(data) // 2
    data[middle : middle + 2] = b"\xff\xc4"
    assert inspect_jpeg(bytes(data)) is None


@pytest.mark.parametrize("data", [b"", b"\xff", b"\xff\xd8", b"\xff\xd8\xff", b"\x89PNG\r\n", b"\0" * 99])
def test_what_is_no_picture(data: bytes) -> None:
    assert inspect_jpeg(data) is None


def test_random_bytes_never_raise() -> None:
    generator = np.random.default_rng(1)
    for _ in range(2000):
        size = int(generator.integers(0, 200))
        inspect_jpeg(b"\xff\xd8" + generator.integers(0, 256, size).astype(np.uint8).tobytes())
