"""Check ``meta/info.json``: its fields by themselves, and against each other."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from joshua_dataset.checks.contents import Contents, is_whole, shown
from joshua_dataset.checks.problem import Kind, Problem, repairing
from joshua_dataset.metadata import INDEX_COLUMNS, INFO, MESSAGES, OURS, STAMP, SUFFIXES
from joshua_dataset.reader import NUMBER_TYPES

#: Fields whose absence stops LeRobot, with the names of their types.
_NEEDED = {
    "codebase_version": "text",
    "fps": "a whole number above 0",
    "total_episodes": "a whole number",
    "total_frames": "a whole number",
    "features": "an object",
    "data_path": "text",
}

#: Fields that are whole numbers above 0 where they are present; LeRobot needs them to append.
_SIZES = ("chunks_size", "data_files_size_in_mb", "video_files_size_in_mb")

_SPLIT = re.compile(r"(\d+):(\d+)")


def problems(contents: Contents) -> Iterator[Problem]:
    """Yield the problems of ``meta/info.json``."""
    info = contents.info
    if not info:
        return
    yield from _fields(contents)
    yield from _splits(contents)
    yield from _ours(contents)
    features = info.get("features")
    if not isinstance(features, Mapping):
        return
    for key, described in features.items():
        yield from _feature(contents, str(key), described)
    if not contents.has_messages:
        yield from _indices(contents, features)


def _wrong(kind: Kind, text: str, *, serious: bool = True) -> Problem:
    return Problem(kind, f"{INFO}: {text}", serious=serious)


def _fields(contents: Contents) -> Iterator[Problem]:
    info = contents.info
    for name, wanted in _NEEDED.items():
        value = info.get(name)
        is_right = {
            "text": isinstance(value, str) and bool(value),
            "an object": isinstance(value, Mapping) and bool(value),
            "a whole number": is_whole(value),
            "a whole number above 0": _is_rate(value),
        }[wanted]
        if not is_right and name != "codebase_version":
            found = shown(value) if name in info else "missing"
            kind = Kind.INFO_PATH if name.endswith("_path") else Kind.INFO_FIELD
            yield _wrong(kind, f"{name} is {found}; it must be {wanted}")
    for name in _SIZES:
        value = info.get(name)
        if name in info and not (is_whole(value) and value):
            yield _wrong(Kind.INFO_FIELD, f"{name} is {shown(value)}; it must be a whole number above 0")
    video_path = info.get("video_path")
    if _has_videos(info) and not (isinstance(video_path, str) and video_path):
        yield _wrong(Kind.INFO_PATH, f"video_path is {shown(video_path)}; it must be text")
    robot = info.get("robot_type")
    if robot is not None and not isinstance(robot, str):
        yield _wrong(Kind.INFO_FIELD, f"robot_type is {shown(robot)}; it must be text")
    if info.get("total_tasks") is None:
        yield _wrong(Kind.INFO_FIELD, "total_tasks is missing: LeRobot needs it to append", serious=False)
    if contents.is_v3 and "chunks_size" not in info:
        yield _wrong(Kind.INFO_FIELD, "chunks_size is missing: LeRobot needs it to append", serious=False)
    if contents.dataset is not None and not contents.is_v3:
        yield from _totals_of_v2(contents)


def _has_videos(info: Mapping[str, Any]) -> bool:
    features, ours = info.get("features"), info.get(OURS)
    if not isinstance(features, Mapping) or (isinstance(ours, Mapping) and ours.get("format") == "mcap"):
        return False
    return any(isinstance(item, Mapping) and item.get("dtype") == "video" for item in features.values())


def _is_rate(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and bool(np.isfinite(value)) and value > 0 and value == int(value)


def _totals_of_v2(contents: Contents) -> Iterator[Problem]:
    info, dataset = contents.info, contents.dataset
    assert dataset is not None
    cameras = sum(described.get("dtype") == "video" for described in contents.features.values())
    size = info.get("chunks_size")
    expected = {"total_videos": cameras * dataset.episodes}
    if is_whole(size) and size:
        expected["total_chunks"] = -(-dataset.episodes // size)
    for name, count in expected.items():
        if name in info and info[name] != count:
            yield Problem(
                Kind.INFO_TOTALS,
                f"{INFO}: {name} is {shown(info[name])}, and {dataset.episodes} episodes have {count}",
                serious=False,
                remedy=repairing(contents.folder),
            )


def _splits(contents: Contents) -> Iterator[Problem]:
    splits, total = contents.info.get("splits"), contents.info.get("total_episodes")
    if not isinstance(total, int) or not is_whole(total):
        return
    if splits is None:
        yield _split(contents, "splits is missing")
        return
    if not isinstance(splits, Mapping):
        yield _split(contents, f"splits is {shown(splits)}; it must be an object")
        return
    named: set[int] = set()
    for name, text in splits.items():
        match = _SPLIT.fullmatch(text) if isinstance(text, str) else None
        if match is None:
            yield _split(contents, f"the split {shown(name)} is {shown(text)}; it must be FIRST:END")
            return
        first, end = int(match[1]), int(match[2])
        if first > end or end > total:
            yield _split(contents, f"the split {shown(name)} is {first}:{end}, of {total} episodes")
            return
        named.update(range(first, end))
    if len(named) < total:
        yield _split(contents, f"the splits name {len(named)} of {total} episodes")


def _split(contents: Contents, text: str) -> Problem:
    remedy = repairing(contents.folder)
    return Problem(Kind.INFO_SPLITS, f"{INFO}: {text}", serious=False, remedy=remedy)


def _feature(contents: Contents, key: str, described: Any) -> Iterator[Problem]:
    where = shown(key)
    if not isinstance(described, Mapping):
        yield _wrong(Kind.INFO_FEATURE, f"the feature {where} is {shown(described)}; it must be an object")
        return
    dtype, shape, names = described.get("dtype"), described.get("shape"), described.get("names")
    if not isinstance(dtype, str) or dtype not in (*NUMBER_TYPES, "video", "image"):
        yield _wrong(
            Kind.INFO_FEATURE,
            f"{where} has the dtype {shown(dtype)}; allowed: video, image, {', '.join(NUMBER_TYPES)}",
        )
    if not _is_shape(shape):
        yield _wrong(
            Kind.INFO_FEATURE, f"{where} has the shape {shown(shape)}; it must be a list of sizes above 0"
        )
        return
    assert isinstance(shape, list)
    if dtype in ("video", "image"):
        yield from _camera(contents, key, described)
        return
    known = _flat(names)
    if not isinstance(described.get("unit") or "", str):
        yield _wrong(Kind.INFO_FEATURE, f"{where} has the unit {shown(described['unit'])}; it must be text")
    if known is None:
        yield _wrong(Kind.INFO_FEATURE, f"{where} has the names {shown(names)}; they must be texts")
    elif known and len(shape) == 1 and len(known) != shape[0]:
        yield _wrong(Kind.INFO_FEATURE, f"{where} has {shape[0]} numbers and {len(known)} names")
    elif len(set(known)) != len(known):
        yield _wrong(Kind.INFO_FEATURE, f"{where} has a name twice: {shown(names)}")


def _is_shape(shape: Any) -> bool:
    return isinstance(shape, list) and bool(shape) and all(is_whole(size) and size for size in shape)


def _flat(names: Any) -> list[str] | None:
    """Return the names of a feature's numbers; None if they are not texts."""
    if isinstance(names, Mapping):  # {"motors": [...]}, the form of older data sets
        names = next(iter(names.values()), None)
    if names is None:
        return []
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return None
    return names


def _camera(contents: Contents, key: str, described: Mapping[str, Any]) -> Iterator[Problem]:
    shape, names = described["shape"], _flat(described.get("names"))
    where = shown(key)
    if len(shape) != 3:
        yield _wrong(Kind.INFO_FEATURE, f"{where} has the shape {shape}; a picture has three sizes")
        return
    is_first = bool(names) and names is not None and names[0] in ("channels", "channel")
    height, width, channels = (*shape[1:], shape[0]) if is_first else shape
    if channels != 3:
        yield _wrong(Kind.INFO_FEATURE, f"{where} has the shape {shape}; a picture has 3 channels")
    wanted = ["channels", "height", "width"] if is_first else ["height", "width", "channels"]
    if names is None or [name.removesuffix("s") for name in names] != [n.removesuffix("s") for n in wanted]:
        yield _wrong(
            Kind.INFO_FEATURE,
            f"{where} has the names {shown(described.get('names'))}; a picture has {', '.join(wanted)}",
        )
    told = described.get("info") or described.get("video_info") or {}
    if not isinstance(told, Mapping):
        yield _wrong(Kind.INFO_VIDEO, f"{where} has the info {shown(told)}; it must be an object")
        return
    expected = {"video.height": height, "video.width": width, "video.channels": channels}
    fps = contents.info.get("fps")
    if _is_rate(fps):
        expected["video.fps"] = fps
    for name, value in expected.items():
        if name in told and told[name] != value:
            yield Problem(
                Kind.INFO_VIDEO,
                f"{INFO}: {name} of {where} is {shown(told[name])}, but the feature and fps say {value}",
                serious=False,
                remedy=repairing(contents.folder),
            )


def _indices(contents: Contents, features: Mapping[str, Any]) -> Iterator[Problem]:
    """Yield problems of the columns that LeRobot describes as features, too."""
    for name, kind in INDEX_COLUMNS.items():
        described = features.get(name)
        if described is None:
            if name != STAMP:
                yield _wrong(Kind.INFO_FEATURE, f"the feature {name} is missing: LeRobot does not load that")
        elif isinstance(described, Mapping) and described.get("dtype") in NUMBER_TYPES:
            if described["dtype"] != kind:
                yield _wrong(
                    Kind.INFO_FEATURE, f"{name} has the dtype {described['dtype']}; it must be {kind}"
                )
            if _is_shape(described.get("shape")) and described["shape"] != [1]:
                yield _wrong(Kind.INFO_FEATURE, f"{name} has the shape {described['shape']}; it must be [1]")


def _ours(contents: Contents) -> Iterator[Problem]:
    """Yield problems of what ``info.json`` says for us only."""
    told = contents.info.get(OURS)
    if told is None or contents.dataset is None:
        return
    kinds = {"identity": Mapping, "counters": list, "codec": str, "topics": Mapping}
    for name, kind in kinds.items():
        if name in told and not isinstance(told[name], kind):
            yield _wrong(Kind.INFO_FIELD, f"{OURS}.{name} is {shown(told[name])}")
    codecs = {
        str((described.get("info") or {}).get("video.codec") or told.get("codec"))
        for described in contents.features.values()
        if described.get("dtype") == "video"
    }
    if isinstance(told.get("codec"), str) and codecs - {told["codec"]}:
        found = shown(sorted(codecs)[0])
        text = f"{INFO}: {OURS}.codec is {shown(told['codec'])}, and the videos have {found}"
        yield Problem(Kind.VIDEO_CODEC, text, serious=False, remedy=repairing(contents.folder))
    chosen = {
        "format": (contents.dataset.format, tuple(SUFFIXES)),
        "pictures": (contents.dataset.pictures, ("video", "png", "jpeg", MESSAGES)),
    }
    for name, (value, allowed) in chosen.items():
        if name in told and value not in allowed:
            text = f"{OURS}.{name} is {shown(value)}; allowed: {', '.join(allowed)}"
            yield _wrong(Kind.INFO_FIELD, text)
