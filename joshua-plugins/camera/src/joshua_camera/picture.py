"""A picture of the camera as pixels or JPEG."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from joshua_camera.opencv import load_opencv

Pixels = npt.NDArray[np.uint8]

#: Quality of pictures that are compressed here; JPEG files from a camera are published unchanged.
JPEG_QUALITY = 90


@dataclass(frozen=True, eq=False)
class Picture:
    """One picture; either form may be missing.

    Attributes:
        rgb: shape (H, W, 3), uint8, RGB.
        jpeg: a JPEG file.
    """

    rgb: Pixels | None = None
    jpeg: bytes | None = None

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Picture) or self.jpeg != other.jpeg:
            return NotImplemented if not isinstance(other, Picture) else False
        if self.rgb is None or other.rgb is None:
            return self.rgb is other.rgb
        return bool(np.array_equal(self.rgb, other.rgb))

    def __hash__(self) -> int:
        return hash((self.jpeg, None if self.rgb is None else self.rgb.shape))

    def as_rgb(self) -> Pixels | None:
        """Return the pixels; None if the JPEG file cannot be decoded."""
        return self.rgb if self.rgb is not None or self.jpeg is None else decode_jpeg(self.jpeg)

    def as_jpeg(self) -> bytes:
        """The JPEG file."""
        if self.jpeg is not None:
            return self.jpeg
        assert self.rgb is not None
        return encode_jpeg(self.rgb)


def decode_jpeg(data: bytes) -> Pixels | None:
    """Decode a JPEG file to shape (H, W, 3), uint8, RGB; None if that fails."""
    cv2 = load_opencv()
    # OpenCV before 4.11 decodes to BGR only. The EXIF orientation of a phone is ignored because it does not
    # change the size of the stream.
    direct = getattr(cv2, "IMREAD_COLOR_RGB", None)
    flags = (cv2.IMREAD_COLOR if direct is None else direct) | cv2.IMREAD_IGNORE_ORIENTATION
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    if pixels is None:
        return None
    decoded: Pixels = pixels if direct is not None else cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB)
    return decoded


def encode_jpeg(rgb: Pixels) -> bytes:
    """Encode pixels of shape (H, W, 3), uint8, RGB, as a JPEG file."""
    cv2 = load_opencv()
    options = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    done, data = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), options)
    assert done, "OpenCV was built without JPEG"
    return bytes(data)
