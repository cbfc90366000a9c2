"""Data sets of several arms, read as those of one arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt
from joshua.features import FeatureSet
from joshua_dataset.reader import Dataset, Episode
from joshua_dataset.statistics import Statistics

from joshua_imitation.arms import joined_features


@dataclass(frozen=True)
class JoinedArms(Dataset):
    """A data set whose arms are read as one.

    Attributes:
        recorded: the data set as it is; parts: features of the arms, by the feature that they become.
    """

    recorded: Dataset
    parts: Mapping[str, Sequence[str]]

    def statistics(self) -> dict[str, Statistics]:
        """See ``Dataset``."""
        found = self.recorded.statistics()
        for key, parts in self.parts.items():
            if all(part in found for part in parts):
                found[key] = {
                    name: value if name == "count" else np.concatenate([found[part][name] for part in parts])
                    for name, value in found[parts[0]].items()
                }
        return found

    def columns(self, episode: Episode) -> dict[str, npt.NDArray[Any]]:
        """See ``Dataset``."""
        found = self.recorded.columns(episode)
        return found | {
            key: np.concatenate([found[part] for part in parts], axis=1) for key, parts in self.parts.items()
        }


def with_joined_arms(dataset: Dataset) -> Dataset:
    """Return a data set of several arms as one of a single arm, and any other data set as it is."""
    described, parts = joined_features(dataset.info["features"])
    if not parts:
        return dataset
    known = {field.name: getattr(dataset, field.name) for field in fields(Dataset)}
    known["info"] = {**dataset.info, "features": described}
    known["features"] = FeatureSet.from_lerobot(described)
    return JoinedArms(**known, recorded=dataset, parts=parts)
