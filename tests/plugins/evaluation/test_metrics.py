"""What is measured of an episode, and metrics that a plugin brings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joshua_evaluation.metrics import (
    BUILT_IN,
    Episode,
    MetricError,
    load_metric,
    measured,
    spectral_arc_length,
)

RATE_HZ = 100.0


def episode(**changed: Any) -> Episode:
    values: dict[str, Any] = {
        "seed": 4,
        "success": True,
        "truncated": False,
        "rewards": np.array([1.0, -0.5, 2.0]),
        "actions": np.zeros((3, 2)),
        "observations": {"observation.state": np.array([[0.0, 0.0], [0.1, 0.0], [0.2, 0.1], [0.2, 0.1]])},
        "latencies_s": np.array([0.001, 0.002, 0.009]),
        "period_s": 0.04,
    }
    return Episode(**{**values, **changed})


def minimum_jerk(duration_s: float, amplitude: float = 1.0) -> Any:
    """Speed of a motion between two points without jerk, the smoothest of all."""
    at = np.arange(0, 1, 1 / (RATE_HZ * duration_s))
    return amplitude / duration_s * 30 * (at**2 - 2 * at**3 + at**4)


def test_the_figures_of_an_episode() -> None:
    values = {name: measured(metric, episode()) for name, metric in BUILT_IN.items()}
    assert values["success_rate"] == 1.0
    assert values["avg_return"] == 2.5
    assert values["episode_length"] == 3.0
    assert values["inference_latency"] == pytest.approx(2.0)
    assert values["smoothness"] < 0
    assert measured(BUILT_IN["inference_latency"], episode(latencies_s=np.zeros(0))) == 0.0


def test_the_spectral_arc_length_is_that_of_its_paper() -> None:
    """Balasubramanian et al. 2015: about -1.4 for a minimum-jerk motion, whatever its size and duration."""
    smooth = spectral_arc_length(minimum_jerk(1.0), RATE_HZ)
    assert smooth == pytest.approx(-1.41, abs=0.03)
    assert spectral_arc_length(minimum_jerk(1.0, amplitude=7.0), RATE_HZ) == pytest.approx(smooth)
    assert spectral_arc_length(minimum_jerk(2.0), RATE_HZ) == pytest.approx(smooth, abs=0.03)
    two = np.concatenate([minimum_jerk(0.5), np.zeros(25), minimum_jerk(0.5)])
    assert spectral_arc_length(two, RATE_HZ) < smooth - 0.5
    shaking = minimum_jerk(1.0) * (1 + 0.5 * np.sin(2 * np.pi * 8 * np.arange(100) / RATE_HZ))
    assert spectral_arc_length(shaking, RATE_HZ) < smooth - 0.3


def test_an_arm_that_stands_still_is_smooth() -> None:
    assert spectral_arc_length(np.zeros(50), RATE_HZ) == 0.0
    assert spectral_arc_length(np.ones(1), RATE_HZ) == 0.0


def bring(folder: Path, body: str, name: str = "reached_fast", target: str = "toy_metrics:metric") -> None:
    """Installs a distribution with a metric."""
    (folder / "toy_metrics.py").write_text(body)
    info = folder / "toy_metrics-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy-metrics\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[joshua.metrics]\n{name} = {target}\n")


@pytest.fixture
def outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    import sys

    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "toy_metrics", raising=False)
    return tmp_path


def test_a_plugin_brings_a_metric(outside: Path) -> None:
    bring(
        outside,
        "def metric(episode):\n    return episode.success and episode.steps < 10\n\n"
        "metric.rate = True\nmetric.higher = True\n",
    )
    metric = load_metric("reached_fast")
    assert (metric.label, metric.rate, metric.higher) == ("reached fast", True, True)
    assert measured(metric, episode()) == 1.0
    assert measured(metric, episode(success=False)) == 0.0


def test_a_metric_that_fails_is_named_with_the_episode(outside: Path) -> None:
    bring(outside, "def metric(episode):\n    return 1 / 0\n")
    with pytest.raises(MetricError, match=r"reached_fast failed on the episode 4: ZeroDivisionError"):
        measured(load_metric("reached_fast"), episode())


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("metric = 3\n", "is not a function: it must take an Episode"),
        ("import nothing_of_this_name\n", "cannot be loaded: ModuleNotFoundError"),
    ],
)
def test_a_metric_that_cannot_be_loaded_is_named(outside: Path, body: str, said: str) -> None:
    bring(outside, body)
    with pytest.raises(MetricError, match=rf"reached_fast \(toy_metrics:metric\) {said}"):
        load_metric("reached_fast")


def test_a_rate_is_one_or_zero(outside: Path) -> None:
    bring(outside, "def metric(episode):\n    return 0.5\nmetric.rate = True\n")
    with pytest.raises(MetricError, match=r"is a rate and returned 0\.5: it must return True or False"):
        measured(load_metric("reached_fast"), episode())


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_a_figure_is_finite(outside: Path, value: str) -> None:
    bring(outside, f"def metric(episode):\n    return float('{value}')\n")
    said = rf"reached_fast returned {value} on the episode 4: it must return a finite number"
    with pytest.raises(MetricError, match=said):
        measured(load_metric("reached_fast"), episode())


def test_a_metric_that_is_gone_is_named() -> None:
    with pytest.raises(MetricError, match="no plugin adds the metric reached_fast: install it"):
        load_metric("reached_fast")
