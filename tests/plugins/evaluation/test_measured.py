"""Metrics of an evaluation: those of a plugin, and those that cannot be measured."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from evaluated import evaluated, prepared
from joshua_training.run_folder import RunError
from trained_policies import write_policy

ANT: dict[str, Any] = {"environment": 'environment_id: "joshua/Ant-v0"', "episodes": 2}


@pytest.fixture
def bring(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Installs a distribution with the metric ``peak_speed``."""

    def install(body: str) -> None:
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.delitem(sys.modules, "toy_reach", raising=False)
        (tmp_path / "toy_reach.py").write_text(f"def peak(episode):\n    {body}\npeak.unit = 'rad/s'\n")
        info = tmp_path / "toy_reach-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy-reach\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text("[joshua.metrics]\npeak_speed = toy_reach:peak\n")

    return install


WITH_PEAK = 'videos: 0 metrics: ["success_rate", "peak_speed"]'


def test_a_metric_of_a_plugin_is_reported(
    tmp_path: Path, reaching: Path, bring: Callable[[str], None]
) -> None:
    bring("return float(abs(episode.observations['observation.velocity']).max())")
    made, _ = evaluated(tmp_path, reaching, WITH_PEAK)
    found = json.loads((made / "results.json").read_text())["metrics"]["peak_speed"]
    assert (found["label"], found["unit"], found["count"]) == ("peak speed", "rad/s", 3)
    assert found["value"] > 0.1
    assert "peak speed (rad/s)" in (made / "report.html").read_text()


def test_a_metric_that_fails_leaves_the_other_figures(
    tmp_path: Path, random_policy: Path, reaching: Path, bring: Callable[[str], None]
) -> None:
    """In the last episode of the second checkpoint."""
    bring("peak.calls = getattr(peak, 'calls', 0) + 1; return 1 / (6 - peak.calls)")
    node, context = prepared(
        tmp_path, random_policy, f'{WITH_PEAK} compare_with: "{reaching}"', seed="seed: 40"
    )
    node.activate()
    assert node._ended.wait(120)
    made = node.folder.path
    said = "the metric peak_speed failed on the episode 42: ZeroDivisionError: division by zero"
    with pytest.raises(RunError, match=f"^{said}. The other figures are in {made / 'report.html'}$"):
        context.stop()
    assert context.warnings == [f"{said}; the other figures go on without it"]
    content = json.loads((made / "results.json").read_text())
    assert content["complete"] is True
    assert content["failed"] == {"peak_speed": said}
    for figures in (content, content["compared"]):
        assert list(figures["metrics"]) == ["success_rate"]
        assert figures["metrics"]["success_rate"]["count"] == 3
    assert list(content["compared"]["differences"]) == ["success_rate"]
    assert f"Left out: {said}." in (made / "report.html").read_text()
    rows = list(csv.DictReader((made / "episodes.csv").read_text().splitlines()))
    assert len(rows) == 6
    assert "peak_speed" not in rows[0]


@pytest.fixture
def ant(tmp_path: Path) -> Path:
    """A policy of the ant, which has neither joints of an arm nor a goal."""
    return write_policy(tmp_path / "ant", environment="joshua/Ant-v0")


@pytest.mark.parametrize(
    ("metric", "needs"), [("smoothness", "observation.state"), ("success_rate", "is_success")]
)
def test_a_metric_that_the_environment_cannot_give_is_refused(
    tmp_path: Path, ant: Path, metric: str, needs: str
) -> None:
    node, context = prepared(tmp_path, ant, f'metrics: ["{metric}"]', **ANT)
    node.activate()
    assert node._ended.wait(60)
    with pytest.raises(Exception, match=f"{metric} requires {needs}, which joshua/Ant-v0 does not provide"):
        context.stop()


def test_without_a_goal_nothing_speaks_of_success(tmp_path: Path, ant: Path) -> None:
    made, context = evaluated(tmp_path, ant, "videos: 0", **ANT)
    content = json.loads((made / "results.json").read_text())
    assert set(content["metrics"]) == {"avg_return", "episode_length", "inference_latency"}
    mean = content["metrics"]["avg_return"]["value"]
    assert context.shown == f"return {mean:.4g}"
    assert context.ends == [f"2 episodes: return {mean:.4g}, {made / 'report.html'}"]
    assert "success" not in (made / "report.html").read_text().partition("</style>")[2]
    rows = list(csv.DictReader((made / "episodes.csv").read_text().splitlines()))
    assert [row["success"] for row in rows] == ["", ""]
