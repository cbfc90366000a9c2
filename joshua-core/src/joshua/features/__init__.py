"""Observations and actions of a robot, in one vocabulary for models, recorders, environments and evaluation.

Names are loaded at first use, because deriving and comparing features does not need numpy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from joshua.plan.feature import ACTION, IMAGES, STATE, Feature
from joshua.plan.lazy import lazy_names

if TYPE_CHECKING:
    from joshua.features.aligner import Alignment, FeatureCounts, TimeAligner
    from joshua.features.derive import camera_key, features_of, own_names
    from joshua.features.episodes import DatasetLayout, EpisodeError, EpisodeWriter
    from joshua.features.feature_set import FeatureSet
    from joshua.features.frame import FeatureError, Frame, checked
    from joshua.features.joint_units import CalibratedJoint, JointUnits, Unit

__all__ = [
    "ACTION",
    "IMAGES",
    "STATE",
    "Alignment",
    "CalibratedJoint",
    "DatasetLayout",
    "EpisodeError",
    "EpisodeWriter",
    "Feature",
    "FeatureCounts",
    "FeatureError",
    "FeatureSet",
    "Frame",
    "JointUnits",
    "TimeAligner",
    "Unit",
    "camera_key",
    "checked",
    "features_of",
    "own_names",
]

_LATER = {
    "aligner": ("Alignment", "FeatureCounts", "TimeAligner"),
    "derive": ("camera_key", "features_of", "own_names"),
    "episodes": ("DatasetLayout", "EpisodeError", "EpisodeWriter"),
    "feature_set": ("FeatureSet",),
    "frame": ("FeatureError", "Frame", "checked"),
    "joint_units": ("CalibratedJoint", "JointUnits", "Unit"),
}

__getattr__, __dir__ = lazy_names(
    __name__, {f"{__name__}.{module}": names for module, names in _LATER.items()}
)
