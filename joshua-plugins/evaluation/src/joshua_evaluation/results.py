"""Figures of an evaluation: for each episode, for all, and for two checkpoints side by side."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from joshua_training.statistics import Difference, Estimate, bootstrap, paired, wilson

from joshua_evaluation.episodes import ranked
from joshua_evaluation.metrics import Episode, Metric, MetricError, measured


@dataclass
class Judged:
    """The episodes of one checkpoint, with the figures of each.

    Attributes:
        name: as in the file; values: of each metric by name, one for each episode.
        failed: metrics that could not be measured, and why.
    """

    name: str
    metrics: Sequence[Metric]
    episodes: list[Episode] = field(default_factory=list)
    values: dict[str, list[float]] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)

    def add(self, episode: Episode) -> list[str]:
        """Add an episode and measure it. Returns why metrics failed, which are not measured any more."""
        self.episodes.append(episode)
        said = []
        for metric in self.metrics:
            try:
                self.values.setdefault(metric.name, []).append(measured(metric, episode))
            except MetricError as error:
                self.failed[metric.name] = str(error)
                said.append(str(error))
        self.leave_out(self.failed)
        return said

    def leave_out(self, names: Collection[str]) -> None:
        """Forget metrics and their values."""
        self.metrics = [metric for metric in self.metrics if metric.name not in names]
        for name in names:
            self.values.pop(name, None)

    @property
    def headline(self) -> tuple[str, str]:
        """Name and value of the most important figure so far: success, else the return."""
        count = max(1, len(self.episodes))
        if any(episode.success is None for episode in self.episodes):
            return "return", f"{sum(episode.rewards.sum() for episode in self.episodes) / count:.4g}"
        return "success", f"{sum(bool(episode.success) for episode in self.episodes) / count:.2f}"

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


def as_text(content: Mapping[str, Any]) -> bytes:
    """Return the text of ``results.json``, in which a figure that is not known is null."""
    return json.dumps(content, indent=2, sort_keys=True, allow_nan=False).encode() + b"\n"


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
            won = "" if episode.success is None else int(episode.success)
            row = (one.name, index, episode.seed, won, int(episode.truncated), episode.steps)
            figures = (f"{one.values[name][index]:.9g}" for name in names)
            parts = (f"{episode.reward_terms.get(name, 0.0):.9g}" for name in terms)
            total = f"{episode.rewards.sum():.9g}" if rewarded else ""
            writer.writerow((*row, total, *figures, *parts))
    return text.getvalue()
