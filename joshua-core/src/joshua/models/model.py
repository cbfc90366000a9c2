"""The base class of models: observations in, joint commands out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class JointSpace:
    """The joints that a model commands: names, and limits of shape (N,) in radians."""

    names: tuple[str, ...]
    position_min_rad: FloatArray
    position_max_rad: FloatArray


@dataclass(frozen=True)
class Observation:
    """What a model sees.

    Attributes:
        stamp_ns: time of the newest part, ns since the epoch.
        messages: newest ROS 2 message of each subscribed topic, by topic name.
        task: instruction in natural language; "" if none.
    """

    stamp_ns: int
    messages: Mapping[str, Any]
    task: str = ""


class Model(ABC):
    """A policy. Order: constructor (no I/O) → ``load`` → ``reset`` → ``act``… → ``close`` (idempotent)."""

    def __init__(self, settings: Any, joints: JointSpace, context: dict[str, Any] | None = None) -> None:
        self.settings = settings
        self.joints = joints
        self.plan_context: dict[str, Any] = context or {}

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
