"""Execution, compute and requirements of a model, known before it is loaded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from joshua.plan.feature import Feature


@dataclass(frozen=True)
class Execution:
    """The block ``execution`` of a model, see ``ModelExecution`` in the schema. The loop chooses for None."""

    strategy: str = "REPLACE_ON_ARRIVAL"
    steps_per_chunk: int | None = None
    observation_max_age_s: float = 1.0
    ramp_s: float = 0.3
    max_velocity_rad_s: float = 0.0
    chunk_timeout_s: float = 10.0
    ensemble_coefficient: float = 0.01
    execution_horizon: int | None = None
    inference_delay: int | None = None
    delay_margin: int = 1
    max_guidance_weight: float = 5.0
    guidance_schedule: str = "GUIDANCE_EXP"


@dataclass(frozen=True)
class Compute:
    """The block ``compute`` of a model, see ``ModelCompute`` in the schema. A seed of None is random."""

    device: str = "auto"
    precision: str = "float32"
    warm_up: int = 1
    seed: int | None = None
    threads: int = 1


@dataclass(frozen=True)
class ModelNeeds:
    """Requirements and abilities of a model, known without loading it.

    Attributes:
        features: required in each observation, by the model's keys. A picture side of 0 and missing names
            match any. None: unknown before the model is loaded.
        action: joints that it commands, in its order and unit; None: unknown.
        reads_state: it receives the state of the joints that it commands, even if the file subscribes to
        none.
        reads_task: it does nothing without a task.
        supports_rtc: it has ``continue_chunk``, for REAL_TIME_CHUNKING.
        chunk_steps: length of its chunks; 0: unknown. rate_hz: of the steps, 0 for any.
        ranges: minimum and maximum of joints in its training, by key and in the unit of the feature.
        source: origin of these values, such as a ``config.json``, for messages.
        libraries: modules that it imports when it is loaded, which the check looks for and does not import.
        install: what to do where one is missing, one imperative sentence.
    """

    features: tuple[Feature, ...] | None = None
    action: Feature | None = None
    reads_state: bool = False
    reads_task: bool = False
    supports_rtc: bool = False
    history: int = 1
    chunk_steps: int = 0
    rate_hz: float = 0.0
    ranges: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]] = field(default_factory=dict)
    source: str = ""
    libraries: tuple[str, ...] = ()
    install: str = ""
