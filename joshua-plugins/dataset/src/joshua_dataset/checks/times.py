"""Check ``fps``, the timestamps and the rates of the videos against each other: two show the third."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from joshua_dataset.checks.contents import Contents, shown
from joshua_dataset.checks.problem import Kind, Problem, of_episodes, repairing
from joshua_dataset.checks.rows import Rows, Stretch
from joshua_dataset.checks.videos import VideoFile, Videos
from joshua_dataset.metadata import INFO

#: Largest distance of a timestamp from ``frame_index`` / ``fps``, s; that of LeRobot for its pictures.
TOLERANCE_S = 1e-4

#: Relative difference of two rates that are the same.
SAME_RATE = 1e-3


def rate_hz(contents: Contents, rows: Rows, videos: Videos) -> float:
    """Return the rate at which a data set was recorded, Hz; 0 if nothing tells.

    It is ``fps``, unless the rows and the videos agree on another rate.
    """
    fps = float(contents.dataset.fps) if contents.dataset is not None else 0.0
    of_rows, of_videos = _of_rows(rows, fps), _of_videos(videos)
    if fps and of_rows and of_videos and not _same(of_rows, fps) and _same(of_rows, of_videos):
        return of_rows
    return fps or of_rows or of_videos


def problems(contents: Contents, rows: Rows, videos: Videos) -> Iterator[Problem]:
    """Yield where rates and timestamps contradict each other."""
    if contents.dataset is None:
        return
    fps = float(contents.dataset.fps)
    recorded = rate_hz(contents, rows, videos)
    remedy = repairing(contents.folder)
    if not _same(recorded, fps):
        told = shown(contents.info.get("fps"))
        text = f"{INFO}: fps is {told}, and the rows and videos are at {recorded:g} Hz"
        yield Problem(Kind.INFO_FPS, text, remedy=remedy)
    yield from _timestamps(contents, rows, recorded)
    for file in videos.files:
        if is_off(file, recorded):
            text = (
                f"{contents.name(file.path)} is at {file.rate_hz:g} Hz, and its rows are at {recorded:g} Hz"
            )
            problem = Problem(Kind.VIDEO_RATE, text, remedy=remedy)
            yield of_episodes(problem, (use.episode for use in file.uses))


def _timestamps(contents: Contents, rows: Rows, fps: float) -> Iterator[Problem]:
    for index, stretches in sorted(rows.by_episode().items()):
        worst_s = max((_worst_s(stretch, fps) for stretch in stretches), default=0.0)
        if worst_s:
            text = f"timestamp is up to {worst_s:.3f} s away from frame_index / fps"
            yield Problem(Kind.TIMESTAMP, text, max(index, -1), remedy=repairing(contents.folder))


def _worst_s(stretch: Stretch, fps: float) -> float:
    """Return the largest distance of a timestamp from its frame's, s; 0 within the tolerance."""
    if stretch.times is None or not len(stretch.times):
        return 0.0
    expected_s = np.arange(stretch.count) / fps
    away_s = np.abs(stretch.times - expected_s)
    rounding_s = np.spacing(expected_s.astype(np.float32)).astype(np.float64)
    is_away = away_s > TOLERANCE_S + rounding_s
    return float(away_s[is_away].max()) if is_away.any() else 0.0


def _of_rows(rows: Rows, fps: float) -> float:
    """Return the rate that all timestamps have; ``fps`` if they have it, 0 if they have none."""
    steps_s = [_step_s(stretch) for stretch in rows.stretches if stretch.count > 1]
    if not steps_s or not all(steps_s):
        return 0.0
    if fps and all(_same(1 / step_s, fps) for step_s in steps_s):
        return fps
    first = steps_s[0]
    return _rounded(1 / first) if all(_same(first, step_s) for step_s in steps_s) else 0.0


def _step_s(stretch: Stretch) -> float:
    """Return the time between two rows of a stretch, s; 0 if it is not always the same."""
    if stretch.times is None:
        return 0.0
    step_s = float(stretch.times[-1] - stretch.times[0]) / (stretch.count - 1)
    if not step_s > 0 or not np.isfinite(step_s):
        return 0.0
    expected_s = stretch.times[0] + np.arange(stretch.count) * step_s
    is_even = np.abs(stretch.times - expected_s).max() <= max(TOLERANCE_S, 1e-2 * step_s)
    return step_s if is_even and abs(stretch.times[0]) <= TOLERANCE_S else 0.0


def _of_videos(videos: Videos) -> float:
    rates = [file.rate_hz for file in videos.files if file.is_open and file.rate_hz]
    return _rounded(rates[0]) if rates and all(_same(rates[0], rate) for rate in rates) else 0.0


def is_off(file: VideoFile, fps: float) -> bool:
    """Return whether the pictures of a video drift from their rows by more than half a frame."""
    if not file.is_open or not file.rate_hz or not fps:
        return False
    frames: Sequence[int] = [use.length for use in file.uses]
    drift_s = abs(1 / file.rate_hz - 1 / fps) * (file.frames or sum(frames))
    return drift_s > 0.5 / fps and not _same(file.rate_hz, fps)


def _same(one: float, two: float) -> bool:
    return abs(one - two) <= SAME_RATE * max(abs(one), abs(two))


def _rounded(rate: float) -> float:
    return float(round(rate)) if _same(rate, round(rate)) else rate
