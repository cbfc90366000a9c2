"""The base class of models: observations in, joint commands out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from joshua.features.feature_set import FeatureSet
from joshua.features.frame import Frame

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class JointSpace:
    """The joints that a model commands: names, and limits of shape (N,) in radians."""

    names: tuple[str, ...]
    position_min_rad: FloatArray
    position_max_rad: FloatArray


@dataclass(frozen=True)
class Observation(Frame):
    """What a model sees: the newest value of each feature; ``stamp_ns`` is that of the newest part.

    Attributes:
        task: instruction in natural language; "" if none.
    """

    task: str = ""


class Model(ABC):
    """A policy. Order: constructor (no I/O) → ``load`` → ``reset`` → ``act``… → ``close`` (idempotent).

    Args:
        settings: made from the block of the file.
        joints: that it commands.
        features: what each observation holds: joints in radians, pictures as (H, W, 3) uint8, RGB.
    """

    def __init__(self, settings: Any, joints: JointSpace, features: FeatureSet | None = None) -> None:
        self.settings = settings
        self.joints = joints
        self.features = features if features is not None else FeatureSet()

    @abstractmethod
    def load(self) -> None:
        """Loads the weights. Raises DeviceError-like ``ModelError`` with a remedy."""

    @abstractmethod
    def reset(self) -> None:
        """Forgets the episode so far."""

    @abstractmethod
    def act(self, observation: Observation) -> FloatArray:
        """Returns the next actions in radians, shape (T, N): T ≥ 1 steps of the publisher's period."""

    @abstractmethod
    def close(self) -> None:
        """Frees the model; a second call does nothing."""


class ModelError(Exception):
    """A model cannot be loaded or run; the message names the model and the remedy."""
