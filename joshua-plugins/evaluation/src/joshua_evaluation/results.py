"""Figures of an evaluation: for each episode, for all, and for two checkpoints side by side."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from joshua_training.statistics import Difference, Estimate, bootstrap, paired, wilson

from joshua_evaluation.episodes import ranked
from joshua_evaluation.metrics import Episode, Metric, measured


@dataclass
class Judged:
    """The episodes of one checkpoint, with the figures of each.

    Attributes:
        name: as in the file; values: of each metric by name, one for each episode.
    """

    name: str
    metrics: Sequence[Metric]
    episodes: list[Episode] = field(default_factory=list)
    values: dict[str, list[float]] = field(default_factory=dict)

    def add(self, episode: Episode) -> None:
        """Add an episode and measure it. Raises MetricError."""
        figures = {metric.name: measured(metric, episode) for metric in self.metrics}
        self.episodes.append(episode)
        for name, value in figures.items():
            self.values.setdefault(name, []).append(value)

    @property
    def success_rate(self) -> float:
        """Success rate so far."""
        return sum(episode.success for episode in self.episodes) / max(1, len(self.episodes))

    @property
    def order(self) -> list[int]:
        """Indices of the episodes from the best to the worst."""
        return ranked(self.episodes)


@dataclass(frozen=True)
class Intervals:
    """Computation of intervals: their level, samples of the bootstrap, and its seed."""

    confidence: float = 0.95
    samples: int = 10_000
    seed: int = 0

    def estimate(self, metric: Metric, values: Sequence[float]) -> Estimate:
        """Estimate a rate with Wilson's interval, a mean with that of the bootstrap."""
        if metric.rate:
            return wilson(round(sum(values)), len(values), self.confidence)
        return bootstrap(values, self.confidence, self.samples, self.seed)

    def difference(self, metric: Metric, first: Sequence[float], second: Sequence[float]) -> Difference:
        """Return the second checkpoint minus the first, in the episodes that both have played."""
        count = min(len(first), len(second))
        return paired(
            first[:count],
            second[:count],
            rate=metric.rate,
            confidence=self.confidence,
            samples=self.samples,
            seed=self.seed,
        )


def as_json(judged: Sequence[Judged], about: Mapping[str, Any], intervals: Intervals) -> dict[str, Any]:
    """Return the content of ``results.json``: the first checkpoint, then the comparison with the second."""
    first = judged[0]
    content: dict[str, Any] = {
        "format": 1,
        **about,
        "checkpoint": first.name,
        "seeds": [episode.seed for episode in first.episodes],
        "episodes": len(first.episodes),
        "confidence": intervals.confidence,
        "metrics": _figures(first, intervals),
        "best_to_worst": first.order,
        "compared": None,
    }
    if len(judged) > 1:
        second = judged[1]
        content["compared"] = {
            "checkpoint": second.name,
            "episodes": len(second.episodes),
            "metrics": _figures(second, intervals),
            "differences": {
                metric.name: asdict(
                    intervals.difference(
                        metric, first.values.get(metric.name, []), second.values.get(metric.name, [])
                    )
                )
                for metric in first.metrics
            },
        }
    return content


def _figures(judged: Judged, intervals: Intervals) -> dict[str, dict[str, Any]]:
    return {
        metric.name: {
            "label": metric.label,
            "unit": metric.unit,
            "higher_is_better": metric.higher,
            **asdict(intervals.estimate(metric, judged.values.get(metric.name, []))),
            "episodes": judged.values.get(metric.name, []),
        }
        for metric in judged.metrics
    }


def as_csv(judged: Sequence[Judged], *, rewarded: bool = True) -> str:
    """Return one row for each episode of each checkpoint; ``rewarded``: the episodes have a return."""
    text = io.StringIO()
    names = [metric.name for metric in judged[0].metrics]
    terms = sorted({name for one in judged for episode in one.episodes for name in episode.reward_terms})
    writer = csv.writer(text, lineterminator="\n")
    fixed = ("checkpoint", "episode", "seed", "success", "truncated", "steps", "return")
    writer.writerow((*fixed, *names, *(f"reward.{name}" for name in terms)))
    for one in judged:
        for index, episode in enumerate(one.episodes):
            row = (one.name, index, episode.seed, int(episode.success), int(episode.truncated), episode.steps)
            figures = (f"{one.values[name][index]:.9g}" for name in names)
            parts = (f"{episode.reward_terms.get(name, 0.0):.9g}" for name in terms)
            total = f"{episode.rewards.sum():.9g}" if rewarded else ""
            writer.writerow((*row, total, *figures, *parts))
    return text.getvalue()
