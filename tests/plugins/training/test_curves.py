"""The picture at the end of a training."""

from __future__ import annotations

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
