"""The picture at the end of a training."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

from joshua_training.curves import draw
from joshua_training.run_folder import RunFolder


def test_every_group_of_metrics_is_a_plot(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "run", {})
    assert draw(folder) is None
    for steps in (10, 20, 30):
        folder.add_metrics({"steps": steps, "loss/train": 1000.0 / steps**3, "rate/updates_per_s": 3.0})
    folder.add_metrics({"steps": 30, "loss/validation": 0.5, "optimiser/learning_rate": 1e-5})
    folder.add_metrics({"steps": 30, "loss/train": float("nan")})
    with (folder.path / "metrics.jsonl").open("a") as file:
        file.write('{"steps": 4')
    path = draw(folder)
    assert path == folder.path / "curves.svg"
    said = path.read_text()
    root = ElementTree.fromstring(said)
    assert len(root.findall("{*}g")) == 2
    for word in ("train", "validation", "learning_rate", ">30<"):
        assert word in said
    assert "updates_per_s" not in said
    assert "nan" not in said


def test_no_word_of_a_legend_covers_another(tmp_path: Path) -> None:
    """Letters are counted as 7.5 wide, bold ones as 8.5, which suits the widest of the usual fonts."""
    folder = RunFolder.create(tmp_path, "run", {})
    losses = (
        "loss",
        "policy_gradient_loss",
        "value_loss",
        "entropy_loss",
        "approx_kl",
        "clip_fraction",
        "std",
    )
    for steps in (10, 50_000_000):
        folder.add_metrics({"steps": steps, **{f"train/{name}": 0.1 * steps for name in losses}})
        folder.add_metrics({"steps": steps, "episode/return": 1.0, "episode/length": 2.0})
    path = draw(folder)
    assert path is not None
    root = ElementTree.fromstring(path.read_text())
    heights = []
    for plot in root.findall("{*}g"):
        heights.append(float(plot.get("transform", "")[len("translate(") : -1].split()[1]))
        taken: dict[float, list[tuple[float, float]]] = {}
        for text in plot.findall("{*}text"):
            x, y = float(text.get("x", "")), float(text.get("y", ""))
            wide = len(text.text or "") * (8.5 if text.get("font-weight") else 7.5)
            left = x - {"end": wide, "middle": wide / 2}.get(text.get("text-anchor", ""), 0.0)
            assert 0 <= left <= left + wide <= 640
            taken.setdefault(y, []).append((left, left + wide))
        for spans in taken.values():
            spans.sort()
            assert all(one[1] <= other[0] for one, other in pairwise(spans)), spans
        assert len({line.get("stroke") for line in plot.findall("{*}polyline")}) == len(
            plot.findall("{*}polyline")
        )
    assert heights[1] - heights[0] > 220  # the second line of the legend has room of its own
    assert float(root.get("viewBox", "").split()[3]) == heights[1] + 220
