"""Decide what of a damaged data set is kept: the longest whole prefix of each episode."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt
import pyarrow as pa
from joshua.api.files import inside, safe_name, tree_inside
from joshua.features import Feature, FeatureSet

from joshua_dataset.decoding import DatasetError, picture_of
from joshua_dataset.mending import description, footage, runs, tasks
from joshua_dataset.mending.evidence import Evidence
from joshua_dataset.mending.footage import Clip, Video
from joshua_dataset.mending.runs import Run
from joshua_dataset.metadata import CHUNK_SIZE, OURS


@dataclass(frozen=True)
class Part:
    """An episode that is kept, with all or the first of its frames.

    Attributes:
        run: its rows; length: frames that are kept; described: its row in the table of episodes.
        clips: where its pictures are, by camera; tasks: index of each of its frames.
    """

    run: Run
    length: int
    described: Mapping[str, Any]
    clips: Mapping[str, Clip]
    tasks: npt.NDArray[np.int64]


@dataclass
class Plan:
    """What becomes of a data set.

    Attributes:
        fps: frames per second; described: the features, as ``info.json`` describes them; features: as read.
        parts: the episodes that are kept, in order; texts: of the tasks.
        schema: of the tables of rows.
        cut: what ends an episode early, by episode; aside: why an episode is not kept, by its name.
        unknown: episodes with a row whose task nothing says.
    """

    fps: int
    described: dict[str, Any]
    features: FeatureSet
    parts: list[Part] = field(default_factory=list)
    texts: tuple[str, ...] = ()
    schema: pa.Schema | None = None
    cut: dict[int, str] = field(default_factory=dict)
    aside: dict[str, str] = field(default_factory=dict)
    unknown: tuple[int, ...] = ()


Mended = Callable[[Video, Feature, int], Video]
"""Makes a video whole and evenly timed, for the frames per second; returns one with what became of it."""


def plan(evidence: Evidence, mended: Mended, refused: Mapping[int, str], task: str) -> Plan:
    """Decide what is kept.

    Args:
        mended: makes a video whole; refused: why an episode must not be kept, by episode.
        task: of the rows for which nothing says it, "" for none.

    Raises:
        EpisodeError: the description cannot be corrected. OSError: of the system.
    """
    described, features = description.features_of(evidence)
    cameras = description.cameras(features, described)
    sizes = {camera.key: footage.size_of(evidence, camera) for camera in cameras}
    described, features = description.with_sizes(described, sizes, features)
    cameras = description.cameras(features, described)
    seen = {camera.key: footage.videos(evidence, camera) for camera in cameras}
    rates_hz = [video.rate_hz for found in seen.values() for video in found if not video.why]
    fps = description.fps_of(evidence, runs.rate_hz(evidence), rates_hz)
    made = Plan(fps, described, features)
    made.aside |= evidence.unreadable
    usable = _usable(evidence, features, described, made)
    kept = _kept(runs.find(usable, _in_tables(features, described, evidence), fps), refused, made)
    lengths = {run.number: run.found for run in kept}
    clips: dict[str, dict[int, Clip]] = {}
    for camera in cameras:
        videos = [mended(video, camera, fps) for video in seen[camera.key]]
        clips[camera.key] = footage.placed(evidence, camera, videos, lengths, fps)
    for feature in features.pictures:
        if feature not in cameras and OURS in evidence.info:
            clips[feature.key] = {run.number: _folder_clip(evidence, feature, run.number) for run in kept}
    assigned = tasks.assign(evidence, kept, task)
    made.texts = assigned.texts
    made.unknown = assigned.unknown
    for run in kept:
        if run.number in assigned.contradictory:
            made.aside[run.label] = assigned.contradictory[run.number]
        elif run.number in assigned.rows:
            _add(made, run, evidence, clips, assigned.rows[run.number])
    return made


def _in_tables(features: FeatureSet, described: Mapping[str, Any], evidence: Evidence) -> FeatureSet:
    """Return the features that have a column."""
    has_pictures = OURS not in evidence.info
    return FeatureSet(
        feature
        for feature in features.values()
        if not feature.is_picture or (has_pictures and described[feature.key]["dtype"] == "image")
    )


def _usable(evidence: Evidence, features: FeatureSet, described: Mapping[str, Any], made: Plan) -> Evidence:
    """Leave out the tables that lack a column, or have it in another type than the most."""
    wanted = _in_tables(features, described, evidence)
    complete = []
    for rows in evidence.rows:
        lacking = [feature.key for feature in wanted.values() if not runs.columns_of(feature, rows.table)]
        if lacking:
            made.aside[rows.path.name] = f"it lacks the column {lacking[0]}"
        else:
            complete.append(rows)
    counts: dict[pa.Schema, int] = {}
    for rows in complete:
        schema = _features_only(rows.table, wanted).schema.remove_metadata()
        counts[schema] = counts.get(schema, 0) + len(rows.table)
    usual = max(counts, key=lambda schema: counts[schema], default=None)
    alike = []
    for rows in complete:
        if _features_only(rows.table, wanted).schema.remove_metadata() == usual:
            alike.append(rows)
        else:
            made.aside[rows.path.name] = "its columns have other types than those of the other tables"
    made.schema = alike[0].table.schema if alike else None
    return replace(evidence, rows=alike)


def _features_only(table: pa.Table, wanted: FeatureSet) -> pa.Table:
    return table.select([name for item in wanted.values() for name in runs.columns_of(item, table)])


def _kept(found: list[Run], refused: Mapping[int, str], made: Plan) -> list[Run]:
    """Return the runs that can become episodes, each number once."""
    kept: dict[int, Run] = {}
    for run in found:
        why = refused.get(run.number, "")
        if not why and not run.whole:
            why = run.why
        elif not why and run.number in kept:
            why = f"another episode {run.number} comes before it"
        elif not why and run.number < 0:
            why = "no column says which episode it is"
        if why:
            made.aside[run.label] = why
        else:
            kept[run.number] = run
    return list(kept.values())


def _folder_clip(evidence: Evidence, feature: Feature, number: int) -> Clip:
    """Look at the picture files of an episode."""
    row = evidence.described.get(number, {})
    places = [row.get(f"videos/{feature.key}/{name}") for name in ("chunk_index", "file_index")]
    chunk, file = (place if isinstance(place, int) else -1 for place in places)
    if min(chunk, file) < 0:
        chunk, file = number // CHUNK_SIZE, number % CHUNK_SIZE
    key = safe_name(feature.key, "the feature")
    folder = inside(evidence.folder, f"images/{key}/chunk-{chunk:03d}/episode-{file:03d}")
    whole = 0
    for number_of_file, path in enumerate(sorted(tree_inside(evidence.folder, folder).glob("frame-*"))):
        if path.stem != f"frame-{number_of_file:06d}" or not _is_picture(path, feature):
            break
        whole += 1
    return Clip(None, folder, 0, whole, f"{feature.key} has no further whole picture")


def _is_picture(path: Path, feature: Feature) -> bool:
    data = path.read_bytes()
    try:
        picture_of(data, path, feature.shape[0], feature.shape[1])
    except (DatasetError, av.FFmpegError, IndexError, ValueError):
        return False
    return True


def _add(
    made: Plan,
    run: Run,
    evidence: Evidence,
    clips: Mapping[str, Mapping[int, Clip]],
    numbers: npt.NDArray[np.int64],
) -> None:
    """Add an episode to what is kept, as far as it is whole."""
    own = {key: found[run.number] for key, found in clips.items() if run.number in found}
    missing = [key for key in clips if key not in own]
    if missing:
        made.aside[run.label] = f"nothing says where its pictures of {missing[0]} are"
        return
    length, why = run.whole, run.why
    for key, clip in own.items():
        if clip.whole < length:
            length, why = clip.whole, f"{key}: {clip.why}"
    if not length:
        made.aside[run.label] = why
        return
    row = evidence.described.get(run.number, {})
    known = row.get("length")
    planned = max(run.found, known) if isinstance(known, int) else run.found
    if length < run.found:
        made.cut[run.number] = f"{length} of its {planned} frames are kept: {why}"
    elif length < planned:
        made.cut[run.number] = f"{length} of its {planned} frames are kept: the other rows are missing"
    made.parts.append(Part(run, length, row, own, numbers[:length]))
