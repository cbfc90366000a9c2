"""How a checkpoint normalises its features, and which of them lack the statistics for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from joshua.features import ACTION

if TYPE_CHECKING:
    from joshua_lerobot.checkpoint import PolicyFeature

#: Statistics that each kind of normalisation requires.
NORMALISED_BY = {
    "MEAN_STD": ("mean", "std"),
    "MIN_MAX": ("min", "max"),
    "QUANTILES": ("q01", "q99"),
    "QUANTILE10": ("q10", "q90"),
}

#: Types whose processors normalise in steps of their own, with statistics that only LeRobot reads.
NORMALISE_OTHERWISE = frozenset(("groot",))

Statistics = Mapping[str, Mapping[str, tuple[float, ...]]]


@dataclass(frozen=True)
class Normaliser:
    """One step of a processor that normalises.

    Attributes:
        modes: how features of each kind (STATE, VISUAL, ACTION …) are normalised, such as ``MEAN_STD``.
        keys: the observations that it normalises; the action is normalised by its kind alone.
        statistics: of each feature by name, such as ``mean``, flattened.
    """

    modes: Mapping[str, str]
    keys: frozenset[str]
    statistics: Statistics = field(default_factory=dict)

    @classmethod
    def of(cls, config: Mapping[str, Any], statistics: Statistics) -> Normaliser | None:
        """Read the configuration of a step; None for a step that does not normalise."""
        modes = config.get("norm_map")
        if not isinstance(modes, Mapping):
            return None
        features = config.get("features")
        keys = frozenset(features if isinstance(features, Mapping) else ())
        limited = config.get("normalize_observation_keys")
        if isinstance(limited, list):
            keys &= frozenset(map(str, limited))
        return cls({str(kind): str(mode) for kind, mode in modes.items()}, keys, statistics)

    def mode(self, kind: str) -> str:
        """Return how features of a kind are normalised."""
        return self.modes.get(kind, "IDENTITY")

    def lacks(self, item: PolicyFeature) -> bool:
        """Return whether it should normalise a feature and cannot."""
        required = NORMALISED_BY.get(self.mode(item.kind), ())
        if not required:
            return False
        if item.key != ACTION and item.key not in self.keys:
            return True
        known = self.statistics.get(item.key, {})
        return any(name not in known for name in required)


def norm_of(item: PolicyFeature, normalisers: Sequence[Normaliser], config: Mapping[str, Any]) -> str:
    """Return how a feature is normalised: by its processor, else as the policy declares; "" if it is not.

    Args:
        item: the feature; normalisers: of its processor; config: of the policy.
    """
    if normalisers:
        modes = [normaliser.mode(item.kind) for normaliser in normalisers]
        return next((mode for mode in modes if mode != "IDENTITY"), "IDENTITY")
    declared = config.get("normalization_mapping")
    return str(declared.get(item.kind, "")) if isinstance(declared, Mapping) else ""


def unnormalised(
    items: Iterable[PolicyFeature], normalisers: Sequence[Normaliser], config: Mapping[str, Any]
) -> tuple[str, ...]:
    """Return the features whose normalisation is declared and does not take place.

    LeRobot passes such values on unchanged, on the scale of the network or of the joints.

    Args:
        items: inputs or outputs of the policy; normalisers: of their processor; config: of the policy.
    """
    if str(config.get("type")) in NORMALISE_OTHERWISE:
        return ()
    lacking = []
    for item in items:
        if normalisers:
            lacks = any(normaliser.lacks(item) for normaliser in normalisers)
        else:
            lacks = norm_of(item, (), config) in NORMALISED_BY
        if lacks:
            lacking.append(item.key)
    return tuple(lacking)
