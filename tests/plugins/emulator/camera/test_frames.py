"""Frames of the emulated camera: valid JPEG for two decoders, with a code that survives."""

from __future__ import annotations

import io
import itertools

import numpy as np
import pytest
from joshua_emulator.camera.frame_code import FrameCode, read_code
from joshua_emulator.camera.frames import CODE_SEGMENTS, FrameSizeError, frame_factory
from joshua_emulator.camera.jpeg_scan import digit_segments, encode
from joshua_emulator.camera.scene import PICTURES, scene
from PIL import Image

SIZES = [(160, 120), (320, 240), (640, 480), (650, 481), (1280, 720)]


def decode(frame: bytes) -> np.ndarray:
    image = Image.open(io.BytesIO(frame))
    return np.asarray(image.convert("RGB"))


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_a_frame_shows_its_number_and_time(width: int, height: int) -> None:
    factory = frame_factory(width, height)
    for number, sent_ns in ((0, 0), (1, 1), (PICTURES, 2**63 - 1), (2**32 - 1, 123_456_789_012)):
        pixels = decode(factory.frame(FrameCode(number, sent_ns)))
        assert pixels.shape == (height, width, 3)
        assert read_code(pixels) == FrameCode(number, sent_ns)


def test_a_joined_frame_is_byte_for_byte_what_an_encoder_writes() -> None:
    # the code's cells drawn into the picture before it is encoded as a whole
    width, height = 320, 240
    code = FrameCode(7, 9_876_543_210)
    frame = frame_factory(width, height).frame(code)
    drawn = scene(width, height)[7].copy()
    decoded = decode(frame)
    rows = 8 * -(-112 // (width // 16))
    drawn[:rows] = np.where(decoded[:rows] > 128, 240, 16)
    last_cell = 112 % (width // 16)
    drawn[rows - 8 : rows, 16 * last_cell :] = scene(width, height)[7][rows - 8 : rows, 16 * last_cell :]
    whole = encode(drawn)
    assert frame == whole.header + whole.tail(0)


def test_a_picture_without_a_code_has_none() -> None:
    assert read_code(np.zeros((480, 640, 3), np.uint8)) is None
    assert read_code(np.full((480, 640), 255, np.uint8)) is None
    assert read_code(np.zeros((4, 4, 3), np.uint8)) is None
    assert read_code(scene(320, 240)[0]) is None


def test_the_code_survives_grey_scale_and_noise() -> None:
    code = FrameCode(12345, 42)
    pixels = decode(frame_factory(320, 240).frame(code))
    noisy = np.clip(pixels + np.random.default_rng(0).normal(0, 20, pixels.shape), 0, 255).astype(np.uint8)
    assert read_code(noisy) == code
    assert read_code(noisy[..., 0]) == code


def test_the_scene_moves_and_repeats() -> None:
    pictures = scene(160, 120)
    assert len(pictures) == PICTURES
    assert all((first != second).any() for first, second in itertools.pairwise(pictures))


def test_segments_decode_on_their_own() -> None:
    assert len(digit_segments()) == 16
    assert len(set(digit_segments())) == 16
    assert CODE_SEGMENTS == 28


@pytest.mark.parametrize(
    ("size", "message"),
    [
        ((64, 48), "64 × 48 has no room for the frame code, 112 cells of 16 × 8 pixels; allowed: 160 × 120"),
        ((8000, 600), "8000 × 600 is too large; allowed: at most 4096 a side"),
    ],
)
def test_sizes_that_cannot_be_served_are_refused(size: tuple[int, int], message: str) -> None:
    with pytest.raises(FrameSizeError, match=message):
        frame_factory(*size)
