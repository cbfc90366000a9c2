"""The checkpoint that a training starts from: its kind of policy and its joints, compared with the file's."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from joshua.features import ACTION, STATE, FeatureSet
from joshua_lerobot.checkpoint import DATASET, Checkpoint, CheckpointError, read_checkpoint


def read_start(folder: Path, policy: str, dataset: str, features: Mapping[str, Any]) -> Checkpoint:
    """Read the checkpoint to start from.

    A checkpoint without a description of its data set has unknown joints, and is not refused for them.

    Args:
        folder: of the checkpoint; policy: type of the file's policy.
        dataset: folder or name, for the message; features: as ``info.json`` describes them.

    Raises:
        CheckpointError: it cannot be used, or is one of another policy or of other joints.
    """
    found = read_checkpoint(folder)
    if found.type != policy:
        raise CheckpointError(
            f"{folder} holds a policy of type {found.type}",
            f'Set policy_type: "{found.type}", or name another checkpoint in pretrained',
        )
    for key in (STATE, ACTION):
        (own, _), wanted = found.described(key), _joints(features, key)
        if own and wanted and own != wanted:
            raise CheckpointError(
                f"The {key} of {folder} has the joints {', '.join(own)}, but that of {dataset} has "
                f"{', '.join(wanted)}; a policy tells its joints apart by their position",
                "Name a checkpoint of the same joints in the same order, or remove pretrained. If only their "
                f"names differ, copy meta/info.json of the data set to {folder / DATASET}",
            )
    return found


def _joints(features: Mapping[str, Any], key: str) -> tuple[str, ...]:
    """Return the joints of a feature, without ``.pos``; () if it has none or is not described well."""
    try:
        names = FeatureSet.from_lerobot({key: features[key]})[key].names
    except (KeyError, TypeError, ValueError, AttributeError):
        return ()
    return tuple(name.removesuffix(".pos") for name in names)
