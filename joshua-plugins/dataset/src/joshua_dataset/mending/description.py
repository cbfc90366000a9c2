"""Correct ``meta/info.json`` where the rows and the videos contradict it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from joshua.features import EpisodeError, Feature, FeatureSet

from joshua_dataset import metadata
from joshua_dataset.mending.evidence import Evidence
from joshua_dataset.mending.footage import Video
from joshua_dataset.metadata import INDEX_COLUMNS, INFO, OURS, STAMP, is_list

_V2_DATA_PATH = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
_V2_VIDEO_PATH = "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4"


def features_of(evidence: Evidence) -> tuple[dict[str, Any], FeatureSet]:
    """Return the features as the rows have them: as described, and read.

    Raises:
        EpisodeError: the rows do not agree on one, or what is described cannot be corrected.
    """
    described = {key: value for key, value in evidence.info["features"].items() if isinstance(value, dict)}
    for key in INDEX_COLUMNS:
        if key in described or key != STAMP:
            described[key] = {"dtype": INDEX_COLUMNS[key], "shape": [1], "names": None}
    for key, value in described.items():
        if value.get("dtype") in ("video", "image") or key in INDEX_COLUMNS:
            continue
        schemas = [rows.table.schema for rows in evidence.rows]
        kinds = {schema.field(key).type for schema in schemas if key in schema.names}
        if len(kinds) == 1 and evidence.suffix == ".parquet":
            described[key] = _as_column(value, kinds.pop(), evidence, key)
    for rows in evidence.rows if evidence.suffix == ".parquet" else ():
        for field in rows.table.schema:
            is_number = pa.types.is_primitive(_element(field.type))
            if field.name not in described and is_number and field.name not in INDEX_COLUMNS:
                described[field.name] = _as_column({"names": None}, field.type, evidence, field.name)
    try:
        return described, FeatureSet.from_lerobot(described)
    except ValueError as error:
        raise EpisodeError(
            f"{evidence.folder / INFO}: {error}. Nothing was changed. Correct it there, then run the same "
            "command again"
        ) from error


def with_sizes(
    described: dict[str, Any], sizes: Mapping[str, tuple[int, int] | None], features: FeatureSet
) -> tuple[dict[str, Any], FeatureSet]:
    """Return the features with the sizes that the pictures have.

    Args:
        sizes: height and width of all pictures, by camera; None if that is not known.
    """
    corrected = dict(described)
    for key, size in sizes.items():
        if size is None or size == features[key].shape[:2]:
            continue
        names = described[key].get("names")
        is_channels_first = isinstance(names, list) and names[:1] == ["channels"]
        shape = [3, *size] if is_channels_first else [*size, 3]
        corrected[key] = described[key] | {"shape": shape}
    return corrected, FeatureSet.from_lerobot(corrected)


def _element(kind: pa.DataType) -> pa.DataType:
    return kind.value_type if is_list(kind) else kind


def _as_column(value: Mapping[str, Any], kind: pa.DataType, evidence: Evidence, key: str) -> dict[str, Any]:
    """Return the description of a feature with the type and the size of its column."""
    element = _element(kind)
    if not (pa.types.is_floating(element) or pa.types.is_integer(element) or pa.types.is_boolean(element)):
        return dict(value)
    dtype = str(np.dtype(element.to_pandas_dtype()))
    size = _size(evidence, key)
    corrected = dict(value) | {"dtype": dtype}
    shape = value.get("shape")
    is_right = isinstance(shape, list) and all(isinstance(n, int) for n in shape) and _product(shape) == size
    if size and not is_right:
        corrected["shape"] = [size]
    names = corrected.get("names")
    if isinstance(names, list) and size and len(names) != size and corrected["shape"] == [size]:
        corrected["names"] = None
    return corrected


def _product(shape: Sequence[int]) -> int:
    return int(np.prod(shape))


def _size(evidence: Evidence, key: str) -> int:
    """Return how many numbers most of the rows have in a column; 0 without rows."""
    counts: dict[int, int] = {}
    for rows in evidence.rows:
        if key not in rows.table.column_names:
            continue
        column = rows.table.column(key)
        if not is_list(column.type):
            counts[1] = counts.get(1, 0) + len(column)
            continue
        for size in pc.list_value_length(column).to_pylist():
            counts[size or 0] = counts.get(size or 0, 0) + 1
    return max(counts, key=lambda size: counts[size], default=0)


def fps_of(evidence: Evidence, rows_hz: int | None, rates_hz: Sequence[Fraction | None]) -> int:
    """Return the frames per second: as described, unless the rows and the videos agree on another rate.

    Args:
        rows_hz: of the timestamps, None if they have none; rates_hz: of the videos.

    Raises:
        EpisodeError: nothing says it.
    """
    described = evidence.info.get("fps")
    is_usable = isinstance(described, int) and not isinstance(described, bool) and described >= 1
    seen_hz = {rate for rate in rates_hz if rate is not None}
    others_agree = rows_hz is not None and seen_hz <= {Fraction(rows_hz)}
    if rows_hz is not None and (others_agree or not is_usable):
        return rows_hz
    if isinstance(described, int) and is_usable:
        return described
    raise EpisodeError(
        f"{evidence.folder / INFO} has the fps {described!r}, and neither its rows nor its videos have one "
        "rate. Nothing was changed. Correct it there, then run the same command again"
    )


def info_of(
    evidence: Evidence,
    described: dict[str, Any],
    fps: int,
    *,
    lengths: Sequence[int],
    tasks: int,
    videos: Mapping[str, Sequence[Video]],
) -> dict[str, Any]:
    """Return the content of ``meta/info.json`` for what is kept.

    Args:
        described: its features; lengths: frames of the episodes; tasks: how many; videos: by camera.
    """
    info = dict(evidence.info)
    count = len(lengths)
    size = chunk_size(evidence)
    features = {key: dict(value) for key, value in described.items()}
    for key, found in videos.items():
        entry = "video_info" if "video_info" in features[key] else "info"
        known = features[key].get(entry)
        if not isinstance(known, dict):
            known = {}
        height, width = _height_width(features[key])
        seen: dict[str, Any] = {"video.fps": fps, "video.height": height, "video.width": width}
        seen |= {"video.channels": 3, "video.is_depth_map": False}
        facts: dict[str, set[Any]] = {
            "video.codec": {video.codec for video in found} - {""},
            "video.pix_fmt": {video.pixel_format for video in found} - {""},
            "has_audio": {video.has_audio for video in found},
        }
        seen |= {name: next(iter(values)) for name, values in facts.items() if len(values) == 1}
        features[key][entry] = known | seen
    info |= {
        "codebase_version": evidence.version,
        "total_episodes": count,
        "total_frames": sum(lengths),
        "total_tasks": tasks,
        "chunks_size": size,
        "fps": fps,
        "splits": {"train": f"0:{count}"},
        "features": features,
    }
    if evidence.is_v3:
        info["data_path"] = metadata.DATA_PATH + evidence.suffix
        info.setdefault("data_files_size_in_mb", 100)
        info.setdefault("video_files_size_in_mb", 200)
    else:
        info["data_path"] = _V2_DATA_PATH
        info["total_videos"] = count * len(videos)
        info["total_chunks"] = -(-count // size)
    if videos:
        info["video_path"] = metadata.VIDEO_PATH if evidence.is_v3 else _V2_VIDEO_PATH
    elif OURS in info and any(value.get("dtype") == "image" for value in features.values()):
        info["video_path"] = metadata.PICTURES_PATH
    return info


def _height_width(described: Mapping[str, Any]) -> tuple[int, int]:
    feature = FeatureSet.from_lerobot({"picture": described})["picture"]
    return feature.shape[0], feature.shape[1]


def chunk_size(evidence: Evidence) -> int:
    """Return how many files a folder holds."""
    size = evidence.info.get("chunks_size")
    if isinstance(size, int) and not isinstance(size, bool) and 1 <= size <= 1_000_000:
        return size
    return metadata.CHUNK_SIZE


def cameras(features: FeatureSet, described: Mapping[str, Any]) -> list[Feature]:
    """Return the features whose pictures are videos."""
    return [feature for feature in features.pictures if described[feature.key]["dtype"] == "video"]
