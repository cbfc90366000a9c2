"""``joshua policy``: look at checkpoints of policies, fetch them from the hub, and export them to ONNX."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

SUMMARY = "show, download and export checkpoints of policies"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the actions of ``joshua policy``."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    one(actions, "show", "show what a checkpoint requires of the robot, without loading it")
    one(actions, "fetch", "download a checkpoint from the hub, with the language model that it builds on")
    export = one(actions, "export", "write a policy as ONNX, which runs without PyTorch (joshua-onnx)")
    export.add_argument("target", type=Path, metavar="TARGET", help="folder of the exported policy")


def one(actions: Any, name: str, text: str) -> argparse.ArgumentParser:
    """Add an action on one checkpoint."""
    parser: argparse.ArgumentParser = actions.add_parser(name, help=text)
    parser.add_argument("checkpoint", metavar="CHECKPOINT", help="a folder, or an id on the hub")
    parser.add_argument("--revision", default="", help="branch, tag or commit on the hub")
    return parser


def run(arguments: argparse.Namespace) -> int:
    """Run the action. Exit code 0; 1 for a checkpoint that cannot be used; 3 for a missing library."""
    from joshua.api import ModelError
    from joshua.tools import ExitCode

    from joshua_lerobot.checkpoint import CheckpointError

    try:
        return int(globals()[f"_{arguments.action}"](arguments))
    except (CheckpointError, ModelError) as error:
        sys.stderr.write(f"joshua policy {arguments.action}: {error}\n")
        return int(getattr(error, "exit_code", ExitCode.FAILED))


def _show(arguments: argparse.Namespace) -> int:
    sys.stdout.write("\n".join(description(_folder(arguments))) + "\n")
    return 0


def _fetch(arguments: argparse.Namespace) -> int:
    from joshua_lerobot.checkpoint import read_checkpoint
    from joshua_lerobot.hub import fetch_language_model

    folder = _folder(arguments, download=True)
    checkpoint = read_checkpoint(folder)
    fetch_language_model(checkpoint)
    sys.stdout.write(f"{arguments.checkpoint}: {folder}\n")
    return 0


def _export(arguments: argparse.Namespace) -> int:
    import importlib.util

    from joshua.tools import ExitCode, install, load_target

    if importlib.util.find_spec("joshua_onnx") is None:
        sys.stderr.write(
            f"joshua policy export requires the plugin joshua-onnx, which is not installed: "
            f"{install('joshua-onnx', 'export')}\n"
        )
        return ExitCode.NOT_INSTALLED
    export = load_target("joshua_onnx.exporting:export")
    for line in export(_folder(arguments), arguments.target):
        sys.stdout.write(f"{line}\n")
    return 0


def _folder(arguments: argparse.Namespace, *, download: bool = False) -> Path:
    """Return the folder of a checkpoint: on this machine, or downloaded. Raises CheckpointError."""
    from joshua_lerobot.hub import cached, fetch, is_hub_id

    name, revision = arguments.checkpoint, arguments.revision
    folder = Path(name).expanduser()
    if folder.exists() or not is_hub_id(name):
        return folder
    found = None if download else cached(name, revision)
    return found or fetch(name, revision)


def description(folder: Path) -> Iterator[str]:
    """Describe what a checkpoint requires, line by line. Raises CheckpointError."""
    from joshua.features import ACTION, STATE

    from joshua_lerobot.checkpoint import read_checkpoint
    from joshua_lerobot.settings import LeRobotSettings

    checkpoint = read_checkpoint(folder)
    unit = LeRobotSettings(weights=str(folder)).unit_of(checkpoint)
    yield f"{folder}: {checkpoint.type}"
    rows = []
    for side, features in (("sees", checkpoint.inputs), ("does", checkpoint.outputs)):
        for item in features:
            size = f"{item.shape[-1]} x {item.shape[-2]}" if item.kind == "VISUAL" else f"{item.shape[0]}"
            size += f" {unit}" if item.key in (STATE, ACTION) else ""
            names = ", ".join(checkpoint.described(item.key)[0])
            rows.append((side, item.key, size, checkpoint.norms.get(item.key, ""), names))
    widths = [max(len(row[column]) for row in rows) for column in range(4)] if rows else []
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, (*widths, 0), strict=True))
        yield f"  {'  '.join(cells)}".rstrip()
    config = checkpoint.config
    if steps := config.get("chunk_size") or config.get("n_action_steps"):
        yield f"  chunk of {steps} actions" + (f" at {checkpoint.fps:g} Hz" if checkpoint.fps else "")
    if checkpoint.unnormalised:
        yield (
            f"  no statistics of {', '.join(checkpoint.unnormalised)}, which it normalises: it does not run "
            "before it is trained on data of your robot"
        )
