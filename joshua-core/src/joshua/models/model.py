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
from joshua.plugins.model_settings import ModelSettings

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class JointSpace:
    """The joints that a model commands: names, and limits of shape (N,) in radians."""

    names: tuple[str, ...]
    position_min_rad: FloatArray
    position_max_rad: FloatArray


@dataclass(frozen=True)
class Observation(Frame):
    """The input of a model: the newest value of each feature. ``stamp_ns`` is the newest of their stamps.

    Attributes:
        task: instruction in natural language; "" if none.
        earlier: observations one, two, … periods before, as many as the model's needs look back at.
    """

    task: str = ""
    earlier: tuple[Observation, ...] = ()


@dataclass(frozen=True)
class ChunkRequest:
    """The previous chunk that a new one continues, for real-time chunking (Black, Galliker, Levine 2025).

    Step k is the k-th period after the observation, as in the chunk that the model returns.

    Attributes:
        planned: actions of the previous chunk at steps 0…P-1, radians, shape (P, N); P ≥ ``delay``.
        delay: steps that are executed as planned, because the new chunk arrives after them.
        overlap: steps of ``planned`` that guide the new chunk, including the fixed ones; at most P.
        max_guidance_weight: of a denoising step; schedule: ``exp``, ``linear``, ``ones`` or ``zeros``.
    """

    planned: FloatArray
    delay: int
    overlap: int
    max_guidance_weight: float = 5.0
    schedule: str = "exp"

    def weights(self, steps: int) -> FloatArray:
        """The weight with which each step of the new chunk follows ``planned``: the paper's soft mask."""
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
        joints: the joints that it commands.
        features: of each observation: joints in radians, pictures as (H, W, 3) uint8, RGB.
    """

    def __init__(self, settings: Any, joints: JointSpace, features: FeatureSet | None = None) -> None:
        self.settings = settings
        self.joints = joints
        self.features = features if features is not None else FeatureSet()

    @abstractmethod
    def load(self) -> None:
        """Loads the weights. Raises ``ModelError`` with a remedy."""

    @abstractmethod
    def reset(self) -> None:
        """Starts a new episode: discards all state, and seeds with ``settings.compute.seed`` unless None."""

    @abstractmethod
    def act(self, observation: Observation) -> FloatArray:
        """Returns the next actions in radians, shape (T, N): T ≥ 1 steps of the publisher's period.

        The first belongs to the time of the observation, ``observation.stamp_ns``.
        """

    def continue_chunk(self, observation: Observation, request: ChunkRequest) -> FloatArray:
        """Returns actions like ``act`` that continue a chunk. Requires ``supports_rtc`` in the needs."""
        raise NotImplementedError(f"{type(self).__name__} has no continue_chunk")

    def needs(self) -> ModelNeeds:
        """Requirements and abilities of the loaded model. By default, those that its settings know."""
        return self.settings.needs() if isinstance(self.settings, ModelSettings) else ModelNeeds()

    @abstractmethod
    def close(self) -> None:
        """Frees the model. Idempotent."""


class ModelError(Exception):
    """A model cannot be loaded or run. The message names the model and the remedy, for the user.

    Args:
        text: of the message.
        is_permanent: a restart of its node would fail in the same way, as with weights that are not a number.
    """

    exit_code = 1

    def __init__(self, text: str = "", *, is_permanent: bool = False) -> None:
        super().__init__(text)
        self.is_permanent = is_permanent
