"""Short videos of episodes, for the report: H.264 in MP4, which every browser plays."""

from __future__ import annotations

import io
from collections.abc import Iterable
from fractions import Fraction
from typing import Any


def as_mp4(pictures: Iterable[Any], rate_hz: float) -> bytes:
    """Encode pictures of shape (H, W, 3), uint8, RGB, with even sides."""
    import av

    content = io.BytesIO()
    with av.open(content, "w", format="mp4") as container:
        stream: Any = container.add_stream("libx264", rate=Fraction(rate_hz).limit_denominator(1000))
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": "26", "preset": "veryfast", "threads": "1"}
        for number, picture in enumerate(pictures):
            height, width = (side - side % 2 for side in picture.shape[:2])
            if number == 0:
                stream.width, stream.height = width, height
            frame = av.VideoFrame.from_ndarray(picture[:height, :width].copy(), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return content.getvalue()
