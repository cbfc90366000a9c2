"""Statistics of a running camera: received and lost pictures by cause, rates and latencies."""

from __future__ import annotations

import statistics
from collections import deque
from dataclasses import dataclass

_WINDOW = 300
_NS_PER_S = 1_000_000_000


@dataclass(frozen=True)
class Figures:
    """Statistics since the camera was opened.

    Attributes:
        fps: pictures per second over about the last ten seconds; 0 for fewer than two pictures.
        received: pictures from the camera; delivered: pictures that were published.
        dropped: pictures that a newer one replaced before they were read.
        stale: pictures that had waited in a buffer; damaged: pictures that could not be decoded.
        latency_p50_s, latency_p99_s: from acquisition to delivery, decoding included; 0 if none was
            delivered.
        exposure: present value as text; "" if the camera does not report it.
        pixel_format: of the pictures from the camera; "" if unknown.
        span_ns: times of the first and last picture in ``fps``, monotonic clock.
    """

    fps: float
    received: int
    delivered: int
    dropped: int
    stale: int
    damaged: int
    latency_p50_s: float
    latency_p99_s: float
    exposure: str
    pixel_format: str
    span_ns: tuple[int, int] = (0, 0)

    def line(self) -> str:
        """Return the statistics as one line of text."""
        parts = [
            f"{self.fps:.1f} Hz",
            f"{self.received} pictures",
            f"{self.dropped} dropped",
            f"{self.stale} stale",
            f"{self.damaged} damaged",
        ]
        if self.delivered:
            parts.append(f"latency {self.latency_p50_s * 1e3:.1f} ms")
        if self.exposure:
            parts.append(f"exposure {self.exposure}")
        return ", ".join(parts)


class FigureKeeper:
    """Collects the statistics; the capture thread and the reader each call their own methods."""

    def __init__(self) -> None:
        self.received = self.delivered = self.dropped = self.stale = self.damaged = 0
        self.exposure = self.pixel_format = ""
        self._arrivals_ns: deque[int] = deque(maxlen=_WINDOW)
        self._latencies_ns: deque[int] = deque(maxlen=_WINDOW)

    def arrived(self, now_ns: int) -> None:
        """Count one received picture."""
        self.received += 1
        self._arrivals_ns.append(now_ns)

    def handed_over(self, latency_ns: int) -> None:
        """Count one delivered picture."""
        self.delivered += 1
        self._latencies_ns.append(latency_ns)

    def figures(self) -> Figures:
        """Return the present statistics."""
        arrivals, latencies = list(self._arrivals_ns), sorted(self._latencies_ns)
        span_ns = arrivals[-1] - arrivals[0] if arrivals else 0
        return Figures(
            fps=(len(arrivals) - 1) * _NS_PER_S / span_ns if span_ns else 0.0,
            received=self.received,
            delivered=self.delivered,
            dropped=self.dropped,
            stale=self.stale,
            damaged=self.damaged,
            latency_p50_s=statistics.median(latencies) / _NS_PER_S if latencies else 0.0,
            latency_p99_s=latencies[int(len(latencies) * 0.99)] / _NS_PER_S if latencies else 0.0,
            exposure=self.exposure,
            pixel_format=self.pixel_format,
            span_ns=(arrivals[0], arrivals[-1]) if arrivals else (0, 0),
        )
