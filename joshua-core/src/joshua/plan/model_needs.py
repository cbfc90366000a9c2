"""How a model is carried out, where it computes, and what it needs of the robot, known before loading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from joshua.plan.feature import Feature


@dataclass(frozen=True)
class Execution:
    """The block ``execution`` of a model, see ``ModelExecution`` of the schema; None is left to the loop."""

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
    """The block ``compute`` of a model, see ``ModelCompute`` of the schema; a seed of None is any."""

    device: str = "auto"
    precision: str = "float32"
    warm_up: int = 1
    seed: int | None = None
    threads: int = 1


@dataclass(frozen=True)
class ModelNeeds:
    """What a model needs of the robot and can do, told without loading it.

    Attributes:
        features: that each observation must hold, by the model's own keys; a side of a picture that is 0
            may be any, and a feature without names may have any. None: not known before the model is loaded.
        action: joints that it commands, in its order and unit; None: not known.
        reads_state: it gets the state of the joints that it commands, even if the file subscribes to none.
        reads_task: it does nothing without a task.
        supports_rtc: it has ``continue_chunk``, for REAL_TIME_CHUNKING.
        chunk_steps: length of its chunks; 0: not known. rate_hz: of the steps, 0 for any.
        ranges: least and greatest values of joints in its training, by key and in the unit of the feature.
        source: what says so, such as a ``config.json``, for messages.
        libraries: modules that it imports when it is loaded, which the check looks for and does not import.
        install: what to do where one is missing, one imperative sentence.
    """

    features: tuple[Feature, ...] | None = None
    action: Feature | None = None
    reads_state: bool = False
    reads_task: bool = False
    supports_rtc: bool = False
    chunk_steps: int = 0
    rate_hz: float = 0.0
    ranges: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]] = field(default_factory=dict)
    source: str = ""
    libraries: tuple[str, ...] = ()
    install: str = ""
