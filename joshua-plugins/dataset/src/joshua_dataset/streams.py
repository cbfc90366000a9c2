"""The topics of a recording: newest messages, rates and pictures, and the status of a recorder."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from joshua.api.nodes import TrafficFigures
from joshua.features import Feature
from joshua.messages.arrays import acquired_ns, array_of

from joshua_dataset.reader import picture_of

NS_PER_S = 1_000_000_000

#: Age of a topic's newest message at which it counts as missing.
STALE_S = 1.0

#: Features that hold until a message changes them, and are zero before the first one: their topics carry
#: no message while nothing changes.
LATCHED = ("intervention",)

#: Number of messages for an estimate of another host's clock.
CLOCK_SAMPLES = 60

#: How long a frame waits for a value that is delayed by a camera or a network.
LATENCY_S = 0.25

#: Shortest time on the way of a small message, at most: above it, the network is slow or the clock is behind.
NETWORK_S = 0.05

#: Least rate of a network that carries pictures: 100 Mbit/s.
NETWORK_BYTES_PER_S = 12.5e6

#: Distance from the simulated time beyond which stamps are of another clock.
OTHER_CLOCK_S = 10.0

COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"


@dataclass(frozen=True)
class RecorderStatus:
    """Current state of a recorder.

    Attributes:
        phase: of the session; episode: number of the next or open episode; kept: episodes kept in this run.
        frames: of the open episode; elapsed_s, remaining_s: of the phase, remaining_s 0 if it has no end.
        rates_hz: of each topic; delays_s: shortest time from acquisition to reception, by feature; below 0
            the clock of the publishing host is ahead of this one.
        worst_alignment_s: largest distance of a value from its frame.
        dropped, held: frames of this episode that lacked a value; missing: features that lack one at present.
        queue_s: recorded time to be written; encoder_load: share of a core; free_bytes: of the disk.
    """

    phase: str
    task: str
    episode: int
    kept: int
    wanted: int
    frames: int
    elapsed_s: float
    remaining_s: float
    rates_hz: dict[str, float]
    delays_s: dict[str, float]
    worst_alignment_s: float
    dropped: int
    held: int
    missing: tuple[str, ...]
    queue_s: float
    encoder_load: float
    free_bytes: int
    folder: str
    message: str


@dataclass
class Task:
    """Task that the operator shows; empty for the next task of the file."""

    text: str = ""


class Stream:
    """One feature's topic: its newest message and its rate.

    Attributes:
        traffic: figures of its subscription; None without one.
    """

    def __init__(self, feature: Feature) -> None:
        self.feature = feature
        self.traffic: TrafficFigures | None = None
        self.newest: Any = None
        self.stamp_ns = 0
        self.seen_s = 0.0
        self._stamps: deque[int] = deque(maxlen=30)
        self.is_latched = feature.key.partition(".")[0] in LATCHED
        self._changes: deque[tuple[int, Any]] = deque(maxlen=1000)
        self._delays_ns: deque[int] = deque(maxlen=CLOCK_SAMPLES)
        self._warned = False

    def take(self, message: Any, received_ns: int) -> int:
        """Note a message; return its acquisition time."""
        self.stamp_ns = acquired_ns(message, received_ns)
        self.newest, self.seen_s = message, time.monotonic()
        self._stamps.append(self.stamp_ns)
        self._delays_ns.append(received_ns - self.stamp_ns)
        if self.is_latched:
            self._changes.append((self.stamp_ns, array_of(message, self.feature.names)))
        return self.stamp_ns

    def at(self, stamp_ns: int) -> tuple[Any, int]:
        """Return the value of a latched feature at a time, and since when it is known."""
        for since_ns, value in reversed(tuple(self._changes)):
            if since_ns <= stamp_ns:
                return np.asarray(value, self.feature.dtype).reshape(self.feature.shape), since_ns
        return np.zeros(self.feature.shape, self.feature.dtype), stamp_ns

    @property
    def delay_s(self) -> float:
        """Shortest time from acquisition to reception, of its newest messages; 0 without any.

        This is the shortest network delay, minus the lead of the publisher's clock.
        """
        return min(tuple(self._delays_ns), default=0) / NS_PER_S

    @property
    def transit_s(self) -> float | None:
        """Shortest time from publication to reception, minus the lead of the clock; None if unknown."""
        transits_ns = tuple(self.traffic.transits_ns) if self.traffic is not None else ()
        return min(transits_ns) / NS_PER_S if transits_ns else None

    def clock_warning(self, tolerance_s: float, *, simulated: bool = False) -> str:
        """A warning, once, if the clock of the publisher differs by more than the tolerance; else "".

        Reception alone cannot tell a clock that is behind from a slow network, so a clock counts as behind
        if even the quickest message took longer than a network does. The time that the device itself takes
        is no part of it where messages carry the time of their publication.

        Args:
            simulated: the stamps are simulated time.
        """
        if self._warned or len(self._delays_ns) < CLOCK_SAMPLES:
            return ""
        warning = self._other_clock() if simulated else self._clocks_apart(tolerance_s)
        self._warned = bool(warning)
        return warning

    def _other_clock(self) -> str:
        apart_s = min((delay_ns / NS_PER_S for delay_ns in tuple(self._delays_ns)), key=abs)
        if abs(apart_s) < OTHER_CLOCK_S:
            return ""
        what = "ahead of" if apart_s < 0 else "behind"
        return (
            f"the stamps of {self.feature.topic} are {abs(apart_s):.3g} s {what} the simulated time: "
            "the node that publishes it does not follow /clock. Set its parameter use_sim_time"
        )

    def _clocks_apart(self, tolerance_s: float) -> str:
        delay_s, transit_s = self.delay_s, self.transit_s
        network_s = NETWORK_S + len(getattr(self.newest, "data", ())) / NETWORK_BYTES_PER_S
        longest_s = LATENCY_S if self.feature.is_picture else NETWORK_S
        if transit_s is not None and tolerance_s + network_s < transit_s:
            apart_s = transit_s
        elif delay_s < -tolerance_s or (transit_s is None and delay_s > tolerance_s + longest_s):
            apart_s = delay_s
        elif delay_s > tolerance_s + LATENCY_S:
            return (
                f"messages on {self.feature.topic} arrive {delay_s:.3f} s after their stamps, and "
                f"frames wait {tolerance_s + LATENCY_S:.3f} s for them. The device is slow, and its clock "
                "correct: lower its rate or the picture size"
            )
        else:
            return ""
        what = "ahead of" if apart_s < 0 else "behind"
        return (
            f"the stamps of {self.feature.topic} are {abs(apart_s):.3f} s {what} this machine, "
            f"the tolerance is {tolerance_s:.3f} s. Synchronise the clocks of the hosts with chrony or NTP"
        )

    @property
    def age_s(self) -> float:
        """Age of its newest message."""
        return time.monotonic() - self.seen_s

    @property
    def stamps(self) -> tuple[int, ...]:
        """Acquisition times of its newest messages."""
        return tuple(self._stamps)

    @property
    def period_s(self) -> float:
        """Mean interval between its messages; 0 while it is unknown."""
        span = self._stamps[-1] - self._stamps[0] if len(self._stamps) > 1 else 0
        return span / (len(self._stamps) - 1) / NS_PER_S if span > 0 else 0.0

    @property
    def is_stale(self) -> bool:
        """Whether its newest message is too old."""
        return self.age_s > max(STALE_S, 3 * self.period_s)


def picture(message: Any, feature: Feature) -> Any:
    """Decode the picture of a message, (H, W, 3) RGB. Raises MessageError and DatasetError."""
    if type(message).__msgtype__ != COMPRESSED_IMAGE:
        return array_of(message)
    height, width, _ = feature.shape
    return picture_of(bytes(message.data), Path(feature.topic), height, width)
