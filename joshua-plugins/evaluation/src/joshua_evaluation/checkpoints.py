"""Recognise the files at a path without loading them: a trainer's policy, or a model's weights."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from joshua.tools import describe_pointer, load_registry, parse_json

#: Description and weights written by the trainers of reinforcement learning.
ABOUT, WEIGHTS = "policy.json", "policy.safetensors"

#: Description beside the weights of LeRobot's policies and of policies exported from them.
CONFIG = "config.json"

#: Messages of the plugins that run them.
LEROBOT, ONNX = "joshua.LeRobotPolicy", "joshua.OnnxPolicy"

#: Folder names that are not owners on the hub.
_FOLDERS = ("checkpoints", "models", "outputs", "policies", "runs", "weights")

_HUB_ID = re.compile(r"[A-Za-z0-9][\w.-]*/[\w.-]+")


class CheckpointError(Exception):
    """A checkpoint cannot be evaluated.

    Args:
        message: what is wrong, one sentence; remedy: an imperative.
    """

    exit_code = 1

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(f"{message}: {remedy[0].lower()}{remedy[1:]}")
        self.message, self.remedy = message, remedy

    def __reduce__(self) -> tuple[type[CheckpointError], tuple[str, str]]:
        return type(self), (self.message, self.remedy)


@dataclass(frozen=True)
class Checkpoint:
    """Checkpoint to evaluate.

    Attributes:
        path: of the folder that holds the weights, or a hub id.
        block: message of the model plugin that runs it; "" for the policy of a trainer.
        environment: that it was trained in; "" if the files do not name it.
    """

    path: str
    block: str = ""
    environment: str = ""


def recognise(path: Path, given: str, block: str = "") -> Checkpoint | None:
    """Recognise the content of a path: a checkpoint, the newest one of a run, or a model's weights.

    Args:
        path: absolute; given: as the file names it, which may be a hub id.
        block: message of the model plugin, if the file names one.

    Raises:
        CheckpointError: nothing that can be evaluated; truncated files.

    Returns:
        None if the path does not exist.
    """
    if block:
        return Checkpoint(str(path) if path.exists() else given, block)
    if not path.exists():
        shipped = load_registry().packaged_weights(given)
        if shipped is not None:
            return _policy(shipped)
        first = given.partition("/")[0]
        is_hub_id = _HUB_ID.fullmatch(given) and first not in _FOLDERS and not path.parent.is_dir()
        return Checkpoint(given, LEROBOT) if is_hub_id else None
    if path.is_file():
        raise CheckpointError(f"{path} is a file, but a checkpoint is a folder", f"Write {path.parent}")
    if (path / ABOUT).is_file():
        return _policy(path)
    if (path / "run.json").is_file():
        return _newest(path)
    if (path / CONFIG).is_file():
        return Checkpoint(str(path), ONNX if "onnx" in _json(path / CONFIG) else LEROBOT)
    inner = _below(path, "checkpoints/last/pretrained_model", "last/pretrained_model")
    if inner is not None:
        return Checkpoint(str(inner), LEROBOT)
    raise CheckpointError(
        f"{path} contains neither a run (run.json), nor a policy of a trainer ({ABOUT}), nor one of LeRobot "
        f"({CONFIG})",
        "Name a folder that does, or name the model plugin that runs it in plugin_config",
    )


def _newest(run: Path) -> Checkpoint:
    whole = sorted(path for path in (run / "checkpoints").glob("step_*") if path.is_dir())
    if not whole:
        raise CheckpointError(f"The run {run} has no checkpoint", "Let it train longer, or name another run")
    newest = whole[-1]
    if not (newest / ABOUT).is_file() and (inner := _below(newest)) is not None:
        return Checkpoint(str(inner), LEROBOT)
    return _policy(newest)


def _below(folder: Path, *others: str) -> Path | None:
    """Return the folder of a LeRobot policy's weights: the folder itself, or where trainings put them."""
    places = (folder / name for name in ("", "pretrained_model", *others))
    return next((place for place in places if (place / CONFIG).is_file()), None)


def _policy(folder: Path) -> Checkpoint:
    about = _json(folder / ABOUT)
    if "algorithm" not in about or "features" not in about:
        raise CheckpointError(
            f"{folder / ABOUT} was not written by a trainer of JOSHUA", "Name another checkpoint"
        )
    if not (folder / WEIGHTS).is_file():
        raise CheckpointError(
            f"{folder} is incomplete: it has no {WEIGHTS}", "Name an older checkpoint of the run"
        )
    if (pointer := describe_pointer(folder / WEIGHTS)) is not None:
        raise CheckpointError(*pointer)
    return Checkpoint(str(folder), environment=str(about.get("environment", "")))


def _json(path: Path) -> dict[str, Any]:
    try:
        content = parse_json(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise CheckpointError(
            f"{path} is truncated or not JSON: {error}", "Copy the checkpoint again, or name another one"
        ) from error
    if not isinstance(content, dict):
        raise CheckpointError(f"{path} contains no JSON object", "Name another checkpoint")
    return content
