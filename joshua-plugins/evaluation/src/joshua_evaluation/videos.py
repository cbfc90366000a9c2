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


class Film:
    """The pictures of an episode on a robot, thinned out: however long it takes, a film needs little memory.

    A picture is at most ``WIDTH`` wide. If there are ``MOST`` of them, every other one is dropped, and from
    then on only half as many are taken.
    """

    WIDTH = 320
    MOST = 300

    def __init__(self) -> None:
        self._pictures: list[Any] = []
        self._stamps_ns: list[int] = []
        self._period_ns = 100_000_000
        self._mp4: bytes | None = None

    def wants(self, stamp_ns: int) -> bool:
        """Whether to add a picture of this time."""
        return not self._stamps_ns or stamp_ns - self._stamps_ns[-1] >= self._period_ns

    def add(self, picture: Any, stamp_ns: int) -> None:
        """Add a picture of shape (H, W, 3), uint8, RGB."""
        step = -(-picture.shape[1] // self.WIDTH)
        self._pictures.append(picture[::step, ::step].copy())
        self._stamps_ns.append(stamp_ns)
        if len(self._pictures) > self.MOST:
            self._pictures, self._stamps_ns = self._pictures[::2], self._stamps_ns[::2]
            self._period_ns *= 2

    def develop(self) -> bytes:
        """Return the film as MP4, in the time that the episode took; b"" without a picture. Idempotent."""
        if self._mp4 is None:
            count, stamps_ns = len(self._pictures), self._stamps_ns
            span_s = (stamps_ns[-1] - stamps_ns[0]) / 1e9 if count > 1 else 0.0
            self._mp4 = as_mp4(self._pictures, (count - 1) / span_s if span_s else 10.0) if count else b""
            self._pictures = []
        return self._mp4
