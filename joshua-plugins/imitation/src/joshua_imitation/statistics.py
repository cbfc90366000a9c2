"""Statistics by which a policy normalises: of the data set, of ImageNet, or of a checkpoint."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from joshua_dataset.decoding import DatasetError
from joshua_dataset.reader import Dataset
from joshua_lerobot.checkpoint import read_checkpoint
from joshua_training.run_folder import RunError

#: Mean and spread of the colours of ImageNet, which normalise the input of its pretrained networks.
_IMAGENET = {"mean": (0.485, 0.456, 0.406), "std": (0.229, 0.224, 0.225)}

_COLOURS = 3


def statistics(
    dataset: Dataset, sizes: Mapping[str, tuple[int, int]], imagenet: bool, checkpoint: Path | None
) -> dict[str, dict[str, Any]]:
    """Return the statistics by which a policy normalises, by feature and name.

    The image network of a checkpoint has learned from pictures that its own statistics normalise, so these
    stay. Those of joints are of the data set.

    Args:
        dataset: to learn from; sizes: (height, width) of its pictures by key.
        imagenet: whether the image network is pretrained; checkpoint: folder of the weights, or None.

    Raises:
        RunError: some are missing, or are not numbers.
    """
    wanted = {"action", "observation.state", "observation.environment_state", *sizes}
    remedy = f"run `joshua dataset stats {dataset.folder} --write`"
    try:
        found = {
            key: {name: torch.from_numpy(np.asarray(value, np.float32)) for name, value in values.items()}
            for key, values in dataset.statistics().items()
            if key in wanted
        }
    except DatasetError as error:
        raise RunError(f"{error}: {remedy}") from error
    for key, values in found.items():
        if not all(bool(torch.isfinite(value).all()) for value in values.values()):
            raise RunError(f"the statistics of {key} in {dataset.folder} are not numbers: {remedy}")
    for key in sizes:
        pictures = _of_checkpoint(checkpoint, key) or (_IMAGENET if imagenet else {})
        found.setdefault(key, {}).update(
            {name: torch.tensor(each).reshape(-1, 1, 1) for name, each in pictures.items()}
        )
    lacking = sorted((wanted & set(dataset.info["features"])) - set(found))
    if lacking:
        raise RunError(f"{dataset.folder} has no statistics of {', '.join(lacking)}: {remedy}")
    return found


def _of_checkpoint(folder: Path | None, key: str) -> Mapping[str, tuple[float, ...]]:
    """Return the statistics of a camera; of any camera, if it has no such one and all have the same."""
    if folder is None:
        return {}
    found = read_checkpoint(folder)
    pictures = [found.statistics[item.key] for item in found.cameras if item.key in found.statistics]
    alike = pictures[0] if pictures and all(each == pictures[0] for each in pictures) else {}
    return {
        name: values for name, values in found.statistics.get(key, alike).items() if len(values) == _COLOURS
    }
