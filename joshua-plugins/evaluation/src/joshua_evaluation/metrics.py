"""Metrics of an evaluation: one figure for each episode, and how they are combined.

A plugin adds metrics by entry points of the group ``joshua.metrics``. Each names a function that
takes an ``Episode`` and returns a number, or a bool if the metric is a rate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    FloatArray = npt.NDArray[np.float64]

#: Entry points of plugins that add metrics.
GROUP = "joshua.metrics"

#: Value of ``info`` that says whether the task was done.
SUCCESS = "is_success"

#: SPARC: zeros behind the profile, as a power of two; highest frequency; share of the peak that counts.
_PAD, _CUT_OFF_HZ, _THRESHOLD = 4, 10.0, 0.05


@dataclass(frozen=True)
class Episode:
    """One episode, as metrics see it. Arrays have a row for each step.

    Attributes:
        seed: of its start; success: whether the task was done, None if nothing judges it.
        truncated: whether time ran out.
        rewards: shape (T,); actions: as the environment took them, shape (T, A).
        observations: physical values by feature, such as ``observation.state`` in rad, shape (T + 1, K).
        latencies_s: time of the policy for each decision, a chunk of actions counting once.
        period_s: of a step; reward_terms: the sum of each over the episode, if the environment reports it.
    """

    seed: int
    success: bool | None
    truncated: bool
    rewards: FloatArray
    actions: FloatArray
    observations: Mapping[str, Any]
    latencies_s: FloatArray
    period_s: float
    reward_terms: Mapping[str, float] = field(default_factory=dict)

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.rewards)

    @property
    def outcome(self) -> str:
        """The success in words; "" if nothing judges it."""
        return {True: "success", False: "no success", None: ""}[self.success]


@dataclass(frozen=True)
class Metric:
    """Figure of an episode.

    Attributes:
        label: as shown; unit: of its values, "" for none; rate: the values are 0 or 1.
        higher: whether larger is better; None if neither is.
        needs: feature, or value of ``info``, without which it cannot be measured; "" for none.
    """

    name: str
    label: str
    measure: Callable[[Episode], float | bool]
    unit: str = ""
    rate: bool = False
    higher: bool | None = True
    needs: str = ""


def _success(episode: Episode) -> bool:
    if episode.success is None:
        raise ValueError(f"the environment gives no {SUCCESS}")
    return episode.success


def _return(episode: Episode) -> float:
    return float(episode.rewards.sum())


def _length(episode: Episode) -> float:
    return float(episode.steps)


def _latency_ms(episode: Episode) -> float:
    import numpy as np

    return 1e3 * float(np.median(episode.latencies_s)) if len(episode.latencies_s) else 0.0


def _smoothness(episode: Episode) -> float:
    import numpy as np

    positions = np.asarray(episode.observations["observation.state"], np.float64)
    speed = np.linalg.norm(np.diff(positions, axis=0), axis=1) / episode.period_s
    return spectral_arc_length(speed, 1 / episode.period_s)


def spectral_arc_length(speed: Any, rate_hz: float) -> float:
    """Return the smoothness of a motion: the spectral arc length of its speed, negative, 0 for a still arm.

    SPARC of Balasubramanian, Melendez-Calderon, Roby-Brami and Burdet (2015): values nearer to 0 are
    smoother, whatever the size and the duration of the motion.

    Args:
        speed: of the motion, shape (T,); rate_hz: of its samples.
    """
    import numpy as np

    profile = np.asarray(speed, np.float64)
    if len(profile) < 2 or not profile.any():
        return 0.0
    size = 2 ** (int(np.ceil(np.log2(len(profile)))) + _PAD)
    frequencies = np.arange(size) * rate_hz / size
    spectrum = np.abs(np.fft.fft(profile, size))
    spectrum /= spectrum.max()
    below = frequencies <= min(_CUT_OFF_HZ, rate_hz / 2)
    frequencies, spectrum = frequencies[below], spectrum[below]
    last = int(np.flatnonzero(spectrum >= _THRESHOLD)[-1]) + 1
    frequencies, spectrum = frequencies[:last], spectrum[:last]
    if last < 2:
        return 0.0
    along = np.diff(frequencies) / (frequencies[-1] - frequencies[0])
    return -float(np.sqrt(along**2 + np.diff(spectrum) ** 2).sum())


BUILT_IN: Mapping[str, Metric] = {
    metric.name: metric
    for metric in (
        Metric("success_rate", "success rate", _success, rate=True, needs=SUCCESS),
        Metric("avg_return", "average return", _return),
        Metric("episode_length", "episode length", _length, unit="steps", higher=False),
        Metric("smoothness", "smoothness (SPARC)", _smoothness, needs="observation.state"),
        Metric("inference_latency", "inference latency", _latency_ms, unit="ms", higher=False),
    )
}


def offered() -> dict[str, EntryPoint]:
    """Return the metrics that plugins add, by name, without importing them."""
    return {point.name: point for point in entry_points(group=GROUP)}


def load_metric(name: str) -> Metric:
    """Load a metric by name.

    Raises:
        MetricError: a plugin's metric cannot be loaded.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]
    point = offered().get(name)
    if point is None:
        raise MetricError(f"no plugin adds the metric {name}: install it, or remove the metric")
    try:
        measure = point.load()
    except Exception as error:  # a plugin's code
        reason = f"{type(error).__name__}: {error}"
        raise MetricError(f"the metric {name} ({point.value}) cannot be loaded: {reason}") from error
    if not callable(measure):
        raise MetricError(f"the metric {name} ({point.value}) is not a function: it must take an Episode")
    return Metric(
        name,
        name.replace("_", " "),
        measure,
        unit=str(getattr(measure, "unit", "")),
        rate=bool(getattr(measure, "rate", False)),
        higher=getattr(measure, "higher", None),
    )


def measured(metric: Metric, episode: Episode) -> float:
    """Measure a metric of an episode.

    Raises:
        MetricError: the metric of a plugin fails, or does not return a finite number.
    """
    try:
        value = metric.measure(episode)
        number = float(value)
    except Exception as error:  # a plugin's code
        reason = f"{type(error).__name__}: {error}"
        raise MetricError(
            f"the metric {metric.name} failed on the episode {episode.seed}: {reason}"
        ) from error
    if metric.rate and number not in (0.0, 1.0):
        raise MetricError(
            f"the metric {metric.name} is a rate and returned {number:g}: it must return True or False"
        )
    if not math.isfinite(number):
        raise MetricError(
            f"the metric {metric.name} returned {number:g} on the episode {episode.seed}: it must return a "
            "finite number"
        )
    return number


class MetricError(Exception):
    """A metric cannot be used; the message says which, why, and what to do."""

    exit_code = 1
