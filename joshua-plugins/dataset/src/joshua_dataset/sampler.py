"""The frames of one episode: aligned, completed or dropped as the policy says, and counted."""

from __future__ import annotations

import cmath
import math
from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import Any

from joshua.features import ACTION, Alignment, Frame, TimeAligner

from joshua_dataset.settings import StoreSettings
from joshua_dataset.streams import LATENCY_S, NS_PER_S, Stream

COUNTERS = ("dropped", "held", "worst_alignment_ns")

#: How long a feature may be missing before the episode ends: its node or cable is lost.
LOST_S = 1.0


class Sampler:
    """Makes the frames of an episode; ``push`` runs on transport threads, all else on one thread.

    Args:
        streams: what is recorded; settings: rate, tolerance and policy.
        now_ns: when the episode begins, on the clock of the stamps.

    Attributes:
        counts: frames that lacked a value, by ``COUNTERS``.
        missing: features that the newest frame lacks.
        failed: why the policy discards the episode; "" if it does not.
        over: why the episode cannot continue; "" if it can.
    """

    def __init__(self, streams: Collection[Stream], settings: StoreSettings, now_ns: int) -> None:
        self._streams = {stream.feature.key: stream for stream in streams}
        self._policy = settings.missing
        self.counts = dict.fromkeys(COUNTERS, 0)
        self.missing: tuple[str, ...] = ()
        self.failed = self.over = ""
        self._missing_since_ns: dict[str, int] = {}
        self._last = Frame(0)
        # what the robot does about a frame: its command in the middle of the period that the frame begins
        self._leads_ns = {
            key: NS_PER_S // settings.fps // 2 for key in self._streams if key.startswith(ACTION)
        }
        alignments = {}
        for stream in streams:
            feature = stream.feature
            if stream.is_latched:
                continue
            tolerance_s = settings.tolerance_s or max(1 / settings.fps, stream.period_s)
            smooth = feature.dtype.startswith("float") and feature.key not in self._leads_ns
            alignments[feature.key] = Alignment(
                round(tolerance_s * NS_PER_S), "interpolated" if smooth else "nearest"
            )
        longest_ns = max((item.tolerance_ns for item in alignments.values()), default=0)
        self._wait_ns = longest_ns + round(LATENCY_S * NS_PER_S)
        self._aligner = TimeAligner(alignments, settings.fps, wait_ns=self._wait_ns)
        # so that the first frame has samples on both sides
        begin_ns = now_ns + longest_ns
        period_ns = NS_PER_S // settings.fps
        self._aligner.start(begin_ns + (_phase_ns(streams, period_ns) - begin_ns) % period_ns)

    def push(self, key: str, stamp_ns: int, value: Any) -> None:
        """Take a value; pictures as their message."""
        self._aligner.push(key, stamp_ns - self._leads_ns.get(key, 0), value)

    def poll(self, now_ns: int) -> Iterator[Frame]:
        """Yield the frames to write; sets ``failed`` or ``over`` where the episode ends."""
        frames = self._aligner.poll(now_ns)
        if self._aligner.jumps:
            self.over = "the clock of this machine jumped"
            return
        for frame in frames:
            written = self._judged(frame)
            if self.failed:
                return
            if written is not None:
                yield written
        self._find_lost(now_ns)

    def rest(self, now_ns: int) -> Iterator[Frame]:
        """Yield the last frames that have all their values."""
        for frame in self._aligner.poll(now_ns + self._wait_ns):
            if not frame.missing and not self._aligner.jumps:
                yield self._latched(frame)

    def _judged(self, frame: Frame) -> Frame | None:
        """Apply the policy to a frame; None drops it."""
        for key in frame.values:
            distance = abs(frame.offset_ns(key))
            self.counts["worst_alignment_ns"] = max(self.counts["worst_alignment_ns"], distance)
        missing = self.missing = frame.missing
        self._missing_since_ns = {key: self._missing_since_ns.get(key, frame.stamp_ns) for key in missing}
        if missing and self._policy == "fail":
            self.failed = f"no value of {', '.join(missing)}"
            return None
        if missing:
            if self._policy != "hold" or any(key not in self._last.values for key in missing):
                self.counts["dropped"] += 1
                return None
            self.counts["held"] += 1
            frame = replace(
                frame,
                values={**frame.values, **{key: self._last.values[key] for key in missing}},
                stamps_ns={**frame.stamps_ns, **{key: self._last.stamps_ns[key] for key in missing}},
            )
        self._last = frame
        return self._latched(frame)

    def _latched(self, frame: Frame) -> Frame:
        """Add the values that hold until they change, such as ``intervention``; state the real stamps."""
        found = {key: item.at(frame.stamp_ns) for key, item in self._streams.items() if item.is_latched}
        stamps_ns = {key: stamp_ns + self._leads_ns.get(key, 0) for key, stamp_ns in frame.stamps_ns.items()}
        return replace(
            frame,
            values={**frame.values, **{key: value for key, (value, _) in found.items()}},
            stamps_ns={**stamps_ns, **{key: stamp_ns for key, (_, stamp_ns) in found.items()}},
        )

    def _find_lost(self, now_ns: int) -> None:
        """End the episode if a feature stays missing: further frames would only be dropped or held."""
        for key, since_ns in self._missing_since_ns.items():
            if now_ns - since_ns < LOST_S * NS_PER_S + self._wait_ns:
                continue
            stream = self._streams[key]
            if stream.age_s > max(0.3, 2 * stream.period_s):
                why = f"no message received on {stream.feature.topic} for {stream.age_s:.1f} s"
            else:
                ahead_s = (stream.stamp_ns - now_ns) / NS_PER_S
                why = (
                    f"messages on {stream.feature.topic} have stamps {abs(ahead_s):.2f} s "
                    f"{'ahead of' if ahead_s > 0 else 'behind'} this machine. "
                    "Synchronise the clocks of the hosts (chrony or NTP), or raise tolerance_s"
                )
            self.over = f"{key} is lost: {why}"
            return


def _phase_ns(streams: Collection[Stream], period_ns: int) -> int:
    """Return the frame phase that is nearest to the pictures, for cameras at the frame rate."""
    turn = math.tau / period_ns
    phases = []
    for stream in streams:
        if stream.feature.is_picture and abs(stream.period_s * NS_PER_S / period_ns - 1) < 0.05:
            mean = sum(cmath.exp(1j * turn * (stamp_ns % period_ns)) for stamp_ns in stream.stamps)
            phases.append(round(cmath.phase(mean) / turn) % period_ns)
    # the middle of the shortest arc that holds them all
    phases.sort()
    following = [*phases[1:], *(first + period_ns for first in phases[:1])]
    gaps = [after - before for before, after in zip(phases, following, strict=True)]
    if len(phases) < 2:
        return phases[0] if phases else 0
    widest = gaps.index(max(gaps))
    first = phases[(widest + 1) % len(phases)]
    return first + (period_ns - gaps[widest]) // 2
