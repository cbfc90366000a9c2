"""Evaluations in simulation, played by their node to the end."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from evaluation_files import write_evaluation
from joshua.planner.pipeline import examine
from joshua.planner.request import Request
from joshua.testing.recording_context import RecordingContext
from joshua_evaluation.node import Evaluation


def prepared(folder: Path, checkpoint: Path | str, more: str = "", **options: Any) -> tuple[Any, Any]:
    """The node of a file, configured, and its context."""
    result = examine(Request(str(write_evaluation(folder, checkpoint, more, **options))))
    assert result.plan is not None, result.errors
    (spec,) = result.plan.nodes
    context = RecordingContext(spec)
    node = Evaluation(context)
    node.configure()
    return node, context


def evaluated(folder: Path, checkpoint: Path | str, more: str = "", **options: Any) -> tuple[Path, Any]:
    """Plays an evaluation without videos to its end: its folder and its context."""
    before = set((folder / "runs").glob("*"))
    node, context = prepared(folder, checkpoint, f"bootstrap_samples: 200 {more}", **options)
    node.activate()
    assert node._ended.wait(120)
    context.stop()
    node.deactivate()
    node.cleanup()
    (made,) = set((folder / "runs").glob("*")) - before
    return made, context


def results(folder: Path, checkpoint: Path | str, more: str = "videos: 0", **options: Any) -> dict[str, Any]:
    made, _ = evaluated(folder, checkpoint, more, **options)
    content: dict[str, Any] = json.loads((made / "results.json").read_text())
    return content
