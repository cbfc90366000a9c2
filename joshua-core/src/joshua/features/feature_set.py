"""An ordered set of features by key, and the differences between two sets."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from joshua.plan.feature import Feature
from joshua.plan.safe_paths import check_distinct, safe_name

#: Ending of the names of joints in LeRobot's units.
LEROBOT_SUFFIX = ".pos"

#: Columns of a data set for indices and times of frames.
LEROBOT_COLUMNS = ("timestamp", "stamp_ns", "frame_index", "episode_index", "index", "task_index")


class FeatureSet(Mapping[str, Feature]):
    """The features of a robot, a data set or a model, in order. Immutable.

    Args:
        features: with unique keys, which are names of files and folders, too.

    Raises:
        ValueError: two features have the same key, or a key cannot be a file name (``UnsafePathError``).
    """

    def __init__(self, features: Iterable[Feature] = ()) -> None:
        self._features: dict[str, Feature] = {}
        for feature in features:
            if feature.key in self._features:
                raise ValueError(f"two features are called {feature.key}: rename one of them")
            self._features[safe_name(feature.key, "the feature")] = feature
        check_distinct(self._features, "the features")

    def __getitem__(self, key: str) -> Feature:
        return self._features[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._features)

    def __len__(self) -> int:
        return len(self._features)

    def __repr__(self) -> str:
        return f"FeatureSet({list(self._features.values())})"

    @property
    def pictures(self) -> tuple[Feature, ...]:
        """Those whose values are pictures."""
        return tuple(feature for feature in self._features.values() if feature.is_picture)

    @property
    def numbers(self) -> tuple[Feature, ...]:
        """Those whose values are numbers."""
        return tuple(feature for feature in self._features.values() if not feature.is_picture)

    def differences(self, other: FeatureSet, *, here: str = "here", there: str = "there") -> list[str]:
        """Describe the differences, one sentence per feature. Topics and the order are ignored.

        Args:
            other: the other set; here, there: names of the two sets in the sentences.
        """
        found = [f"{key} is {here} and not {there}" for key in self if key not in other]
        found += [f"{key} is {there} and not {here}" for key in other if key not in self]
        for key in self:
            if key in other:
                found += _differences(self[key], other[key], here, there)
        return found

    def as_lerobot(self) -> dict[str, dict[str, Any]]:
        """Return the features as in ``meta/info.json`` of LeRobot's layout, pictures as videos."""
        described: dict[str, dict[str, Any]] = {}
        for feature in self._features.values():
            dtype = "video" if feature.is_picture else feature.dtype
            described[feature.key] = {
                "dtype": dtype,
                "shape": list(feature.shape),
                "names": list(feature.names) or None,
            } | ({"unit": feature.unit} if feature.unit else {})
        return described

    @classmethod
    def from_lerobot(cls, described: Mapping[str, Mapping[str, Any]]) -> FeatureSet:
        """Reads the features of a data set, without the columns for indices and times.

        Names ending in ``.pos`` are in LeRobot's units if the data set states no unit.

        Raises:
            ValueError: a description is invalid. The message names the feature.
        """
        return cls(
            _from_lerobot(key, values) for key, values in described.items() if key not in LEROBOT_COLUMNS
        )


def _from_lerobot(key: str, values: Mapping[str, Any]) -> Feature:
    try:
        dtype, shape, names = str(values["dtype"]), tuple(map(int, values["shape"])), values.get("names")
        if isinstance(names, Mapping):  # {"motors": [...]}, the form of older data sets
            names = next(iter(names.values()), ())
        known = tuple(map(str, names or ()))
        if dtype in ("video", "image"):
            height, width = shape[1:] if known[:1] == ("channels",) else shape[:2]
            return Feature.picture(key, height, width)
        unit = str(values.get("unit", ""))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ValueError(f"{key} is no description of a feature: {error!r}") from error
    if not unit and known and all(name.endswith(LEROBOT_SUFFIX) for name in known):
        unit = "lerobot"
    return Feature(key, dtype, shape, known, unit)


def _differences(ours: Feature, theirs: Feature, here: str, there: str) -> list[str]:
    parts = []
    for what in ("dtype", "shape", "unit", "names"):
        one, two = getattr(ours, what), getattr(theirs, what)
        if one == two:
            continue
        if what == "names":
            if len(one) == len(two):
                at, (one, two) = next(
                    (i, pair) for i, pair in enumerate(zip(one, two, strict=True)) if pair[0] != pair[1]
                )
                what = f"name {at + 1}"
            else:
                one, two = (", ".join(side) for side in (one, two))
        parts.append(f"{what} {one or 'none'} {here} and {two or 'none'} {there}")
    return [f"{ours.key}: {'; '.join(parts)}"] if parts else []
