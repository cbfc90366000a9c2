"""The base class of models: observations in, joint commands out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from joshua.features.feature_set import FeatureSet
from joshua.features.frame import Frame
from joshua.plan.model_needs import ModelNeeds
from joshua.plugins.settings import ModelSettings

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


@dataclass(frozen=True)
class ChunkRequest:
    """What a new chunk continues, for real-time chunking (Black, Galliker, Levine 2025).

    Step k is the k-th period after the observation, as in the chunk that the model returns.

    Attributes:
        planned: actions of the chunk before at steps 0…P-1, radians, shape (P, N); P ≥ ``delay``.
        delay: steps that are carried out as planned, because the new chunk arrives after them.
        overlap: steps of ``planned`` that guide the new chunk, the fixed ones included; at most P.
        max_guidance_weight: of a denoising step; schedule: ``exp``, ``linear``, ``ones`` or ``zeros``.
    """

    planned: FloatArray
    delay: int
    overlap: int
    max_guidance_weight: float = 5.0
    schedule: str = "exp"

    def weights(self, steps: int) -> FloatArray:
        """How strongly each of so many steps of the new chunk follows ``planned``: the paper's soft mask."""
        at, end = np.arange(steps), min(self.overlap, steps)
        start = min(self.delay, end)
        falling = np.clip((end - at) / (end - start + 1), 0.0, 1.0)
        shapes = {"linear": falling, "ones": np.ones(steps), "zeros": np.zeros(steps)}
        soft = shapes.get(self.schedule, falling * np.expm1(falling) / np.expm1(1.0))
        mask: FloatArray = np.where(at < start, 1.0, np.where(at < end, soft, 0.0))
        return mask


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
        """Returns the next actions in radians, shape (T, N): T ≥ 1 steps of the publisher's period.

        The first is that of the time of the observation, ``observation.stamp_ns``.
        """

    def continue_chunk(self, observation: Observation, request: ChunkRequest) -> FloatArray:
        """Returns actions as ``act`` does that continue a chunk, if the needs say ``supports_rtc``."""
        raise NotImplementedError(f"{type(self).__name__} has no continue_chunk")

    def needs(self) -> ModelNeeds:
        """What the model needs and can do, once it is loaded; what its settings know, unless overridden."""
        return self.settings.needs() if isinstance(self.settings, ModelSettings) else ModelNeeds()

    @abstractmethod
    def close(self) -> None:
        """Frees the model; a second call does nothing."""


class ModelError(Exception):
    """A model cannot be loaded or run; the message names the model and the remedy, and reaches the user."""

    exit_code = 1
