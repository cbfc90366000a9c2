"""Checkpoints of the Hugging Face hub: found on this machine by their path, fetched by the hub's client.

The token comes from the environment (``HF_TOKEN``) or from the file that ``hf auth login`` writes; only
the client reads it.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from joshua_lerobot.checkpoint import CONFIG, PICKLES, WEIGHTS, Checkpoint, CheckpointError, pickled

#: The only files that are downloaded: no pickle, no code.
PATTERNS = ("*.json", "*.safetensors", "*.onnx", "*.txt", "*.model", "*.jinja")

#: Files that SmolVLA uses from its language model; the weights are in the checkpoint.
LANGUAGE_MODEL = ("*.json", "*.txt", "*.model", "*.jinja")


def is_hub_id(weights: str) -> bool:
    """Return whether a name that is not a local folder can be a hub id: ``owner/name``."""
    owner, slash, name = weights.partition("/")
    return bool(slash and owner and name) and "/" not in name and not weights.startswith((".", "/", "~"))


def cached(name: str, revision: str = "") -> Path | None:
    """Return the folder of a checkpoint that was downloaded before; None if there is none."""
    home = os.environ.get("HF_HOME") or os.path.join(  # noqa: PTH118
        os.environ.get("XDG_CACHE_HOME") or "~/.cache", "huggingface"
    )
    place = Path(os.environ.get("HF_HUB_CACHE") or Path(home) / "hub").expanduser()
    place /= f"models--{name.replace('/', '--')}"
    try:
        commit = (place / "refs" / (revision or "main")).read_text(encoding="utf-8").strip()
    except OSError:
        commit = revision
    folder = place / "snapshots" / commit
    return folder if commit and (folder / CONFIG).is_file() else None


def fetch(name: str, revision: str = "") -> Path:
    """Download the missing files of a checkpoint, and return its folder.

    Raises:
        CheckpointError: it cannot be downloaded, or its weights are pickled.
    """
    folder = _download(name, revision, PATTERNS)
    if not (folder / WEIGHTS).is_file():
        _look_for_pickles(name, revision)
    return folder


def _download(name: str, revision: str, patterns: tuple[str, ...]) -> Path:
    if not sys.stderr.isatty():
        os.environ.setdefault("HF_HUB_DISABLE_PROGRESS_BARS", "1")  # read when the client is imported
    try:
        from huggingface_hub import snapshot_download
    except ImportError as error:
        raise CheckpointError(
            f"{name} is on the Hugging Face hub, and huggingface-hub, which downloads from it, is not "
            "installed",
            "Install it: pip install huggingface-hub",
        ) from error
    try:
        return Path(snapshot_download(name, revision=revision or None, allow_patterns=list(patterns)))
    except Exception as error:  # the client's errors differ between its versions
        raise _refused(name, revision, error) from error


def fetch_language_model(checkpoint: Checkpoint) -> None:
    """Download description and tokenizer of the language model that a checkpoint names, if it is on the hub.

    Raises:
        CheckpointError: they cannot be downloaded.
    """
    name = str(checkpoint.config.get("vlm_model_name") or "")
    if is_hub_id(name) and not (checkpoint.folder / name).exists():
        _download(name, "", LANGUAGE_MODEL)


def _look_for_pickles(name: str, revision: str) -> None:
    """Raise CheckpointError if the weights on the hub are pickled: they were not downloaded."""
    from huggingface_hub import HfApi

    try:
        described = HfApi().model_info(name, revision=revision or None)
        files = [item.rfilename for item in described.siblings or ()]
    except Exception:  # noqa: BLE001 - the weights are missing either way, which reading the folder reports
        return
    if found := sorted(file for file in files if Path(file).suffix in PICKLES):
        raise pickled(f"{name} on the hub", found[0])


def _refused(name: str, revision: str, error: Exception) -> CheckpointError:
    """Return what to do about an error of the client, from its name and the status of the hub's reply."""
    names = {kind.__name__ for kind in type(error).__mro__}
    cause: BaseException | None = error
    status = 0
    while cause is not None and not status:
        names |= {kind.__name__ for kind in type(cause).__mro__}
        status = int(getattr(getattr(cause, "response", None), "status_code", 0) or 0)
        cause = cause.__cause__ or cause.__context__
    if "GatedRepoError" in names or status == 403:
        return CheckpointError(
            f"The hub refuses access to {name} (403): its owner must grant it",
            f"Ask for access on the page of {name}, then run `hf auth login` as the user of the robot, or "
            "set HF_TOKEN",
        )
    if "RevisionNotFoundError" in names:
        return CheckpointError(
            f"{name} has no revision {revision!r} on the hub", "Correct revision, or remove it"
        )
    if status == 401 or "RepositoryNotFoundError" in names or status == 404:
        return CheckpointError(
            f"The hub has no checkpoint {name}, or it is private ({status or 404})",
            "Correct the name. For a private one run `hf auth login` as the user of the robot, or set "
            "HF_TOKEN",
        )
    if names & {
        "LocalEntryNotFoundError",
        "OfflineModeIsEnabled",
        "ConnectionError",
        "ConnectError",
        "Timeout",
    }:
        return CheckpointError(
            f"The hub cannot be reached, and {name} was not downloaded to this machine before",
            f"Connect this machine once and run `joshua policy fetch {name}`, or copy the checkpoint here "
            "and "
            "name its folder",
        )
    said = str(error).strip().partition("\n")[0][:200]
    return CheckpointError(
        f"{name} cannot be downloaded: {type(error).__name__}: {said}", "Try again later, or name a folder"
    )
