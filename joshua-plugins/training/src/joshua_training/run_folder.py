"""Folder of a run: settings, metrics, and checkpoints that are complete or absent.

Why one file: what is written into the folder, and how it is read, checked and removed, is one format.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import platform
import re
import shutil
import subprocess
import time
from collections.abc import Callable, Collection, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from joshua.api.files import NO_SPACE, Files, UnsafePathError, inside, safe_name
from joshua.api.texts import HIDDEN, masked
from joshua.tools import describe_pointer, parse_json

#: Number of checkpoints kept beside the one being written.
KEPT = 3

#: Distributions whose versions affect the result of a training.
RECORDED = (
    *("joshua-core", "joshua-training", "joshua-ppo-trainer", "joshua-imitation", "joshua-mujoco-sim"),
    *("joshua-dataset", "joshua-evaluation", "joshua-inference", "joshua-lerobot", "joshua-smolvla"),
    *("joshua-onnx", "joshua-ray", "ray", "onnxruntime", "stable-baselines3", "lerobot", "transformers"),
    *("accelerate", "peft", "diffusers", "torch", "torchvision", "mujoco"),
    *("joshua-mjx-trainer", "jax", "jaxlib", "mujoco-mjx"),
    *("numpy", "gymnasium", "safetensors", "av", "pyarrow"),
    *("joshua-isaac-trainer", "isaacsim", "isaaclab", "rsl-rl-lib"),
)


#: Hidden names of runs and checkpoints that are being removed or written.
_LEFTOVER = re.compile(r"\.(.+)\.part")
_CHECKPOINT = re.compile(r"step_\d{12}")

#: How long a process that was killed may still have its run.
ENDING_S = 5.0


class RunError(Exception):
    """A run or a checkpoint cannot be used; the message says where, why and what to do."""

    exit_code = 1


class LibraryMissing(RunError):
    """A library that the training requires is not installed."""

    exit_code = 3


def unwritable(path: Path, error: OSError, then: str = "") -> RunError:
    """Return the error of a file that cannot be written, with its remedy.

    Args:
        then: what to do after that, such as ``, and start again``.
    """
    remedy = "create it again" if error.errno == errno.ENOENT else "make it writable"
    if error.errno in NO_SPACE:
        remedy = "free some space"
    return RunError(f"{path} cannot be written: {error.strerror or error}: {remedy}{then}")


def unusable(checkpoint: Path, reason: str) -> RunError:
    """Return the error of a checkpoint that cannot be read, which names the one before it."""
    older = [path.name for path in RunFolder.of(checkpoint).checkpoints() if path.name < checkpoint.name]
    remedy = (
        f"remove it, and resume_run continues from {older[-1]}"
        if older
        else "start a new run, because there is no older one"
    )
    return RunError(f"the checkpoint {checkpoint} cannot be used: {reason}: {remedy}")


def read_part(checkpoint: Path, name: str, parse: Callable[[bytes], Any], *keys: str) -> Any:
    """Read a file of a checkpoint.

    Args:
        parse: its content; keys: that the result must have.

    Raises:
        RunError: it is missing, truncated, or from another program; see ``unusable``.
    """
    path = checkpoint / name
    try:
        found = parse(path.read_bytes())
    except FileNotFoundError as error:
        raise unusable(checkpoint, f"{name} is missing") from error
    except MemoryError:  # says nothing of the file
        raise
    except OSError as error:
        raise unusable(checkpoint, f"{name} cannot be read: {error.strerror}") from error
    except Exception as error:  # of json and of safetensors, which is imported only where it is needed
        if (pointer := describe_pointer(path)) is not None:
            raise RunError(": ".join(pointer)) from error
        raise unusable(checkpoint, f"{name} is truncated or damaged ({error})") from error
    if not isinstance(found, dict) or not found.keys() >= set(keys):
        lacking = next((key for key in keys if not isinstance(found, dict) or key not in found), "fields")
        raise unusable(checkpoint, f"{name} has no {lacking}")
    return found


class RunFolder:
    """A folder with ``run.json``, ``metrics.jsonl``, ``tensorboard/`` and ``checkpoints/``.

    Args:
        path: of the folder, which exists.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock: int | None = None

    @classmethod
    def of(cls, checkpoint: Path) -> RunFolder:
        """Return the run of a checkpoint."""
        return cls(checkpoint.parent.parent)

    @classmethod
    def create(cls, parent: Path, name: str, facts: Mapping[str, Any]) -> RunFolder:
        """Create the folder of a new run, named after it and the time.

        Args:
            facts: content of ``run.json``. Secrets in its texts are hidden, as in logs.

        Raises:
            RunError: it cannot be written.
        """
        stamp, number = time.strftime("%Y%m%d-%H%M%S"), 0
        while True:
            path = parent / (f"{name}-{stamp}" + (f"-{number}" if number else ""))
            try:
                if not parent.exists():
                    parent.mkdir(parents=True, exist_ok=True)
                path.mkdir(0o700)
                break
            except FileExistsError:  # of a run that started in the same second
                number += 1
            except OSError as error:
                raise RunError(f"{path} cannot be created: {error.strerror}: set output_folder") from error
        folder = cls(path)
        started = time.strftime("%Y-%m-%dT%H:%M:%S%z")
        folder.write_json("run.json", {**_without_secrets(facts), "started": started})
        return folder

    @classmethod
    def open(cls, path: Path) -> RunFolder:
        """Open the folder of a run.

        Raises:
            RunError: there is none.
        """
        if not (path / "run.json").is_file():
            raise RunError(
                f"{path} is not a run, because it has no run.json: name the folder that a run logs at start"
            )
        return cls(path)

    def lock(self, wait_s: float = ENDING_S) -> None:
        """Keep the run from other processes, until ``unlock`` or the end of this one.

        Args:
            wait_s: for the end of another process.

        Raises:
            RunError: another process writes into the folder, and does not end soon.
        """
        handle, end_s = os.open(self.path, os.O_RDONLY), time.monotonic() + wait_s
        while True:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                if time.monotonic() < end_s:
                    time.sleep(0.1)
                    continue
                os.close(handle)
                raise RunError(
                    f"another process uses the run {self.path}: wait until it ends, stop it, or start a new "
                    "run"
                ) from error
            except OSError:  # a file system without locks
                os.close(handle)
            else:
                self._lock = handle
            return

    def unlock(self) -> None:
        """Leave the run to other processes. Idempotent."""
        handle, self._lock = self._lock, None
        if handle is not None:
            os.close(handle)

    def facts(self) -> dict[str, Any]:
        """Return the content of ``run.json``. Raises RunError."""
        return _json(self.path / "run.json")

    def write(self, name: str, content: bytes) -> Path:
        """Write a file atomically.

        Raises:
            RunError: writing fails.
        """
        path = self.path / name
        try:
            Files().write(path, content)
        except OSError as error:
            raise unwritable(path, error) from error
        return path

    def write_json(self, name: str, content: Mapping[str, Any]) -> None:
        """Write a JSON file atomically. Raises RunError."""
        self.write(name, json.dumps(content, indent=2, sort_keys=True).encode() + b"\n")

    def add_metrics(self, row: Mapping[str, Any]) -> None:
        """Append a line to ``metrics.jsonl``."""
        with (self.path / "metrics.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")

    def cut_metrics(self, steps: int) -> None:
        """Remove lines after a number of steps, which a continued run computes again, and truncated ones.

        Raises:
            RunError: the file cannot be written.
        """
        path = self.path / "metrics.jsonl"
        if not path.is_file():
            return
        kept = []
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            try:
                if parse_json(line)["steps"] <= steps:
                    kept.append(line + "\n")
            except (ValueError, KeyError, TypeError):
                continue
        self.write(path.name, "".join(kept).encode())

    def checkpoints(self) -> list[Path]:
        """Return the complete checkpoints, the oldest first."""
        return sorted(path for path in self._checkpoints.glob("step_*") if path.is_dir())

    @property
    def _checkpoints(self) -> Path:
        """The folder of the checkpoints. Raises RunError for one elsewhere."""
        try:
            return inside(self.path, "checkpoints", "the folder of the checkpoints")
        except UnsafePathError as error:
            raise RunError(f"{self.path}: {error}") from error

    @property
    def then(self) -> str:
        """What to do when the cause of a failure is removed, for a message."""
        if self.checkpoints():
            return "continue with resume_run; the last checkpoint is complete"
        return "start again; the run has no checkpoint yet"

    def save(self, steps: int, files: Mapping[str, bytes]) -> Path:
        """Write a checkpoint of some files, see ``save_by``."""

        def write(draft: Path) -> None:
            for name, content in files.items():
                (draft / safe_name(name, "the file")).write_bytes(content)

        return self.save_by(steps, write)

    def checkpoint(self, steps: int) -> Path:
        """Return the folder of the checkpoint after some steps."""
        return self._checkpoints / f"step_{steps:012d}"

    def save_by(self, steps: int, write: Callable[[Path], None]) -> Path:
        """Write a checkpoint, move it into place atomically, and remove old ones.

        Args:
            steps: of the training so far; write: puts the files into an empty folder, and folders below it.

        Raises:
            RunError: writing fails; earlier checkpoints stay unchanged.
        """
        final = self.checkpoint(steps)
        folder, draft = final.parent, final.with_name(f".{final.name}.part")
        if final.is_dir():
            return final
        for left in folder.glob(".step_*.part"):  # of a process that was killed
            shutil.rmtree(left, ignore_errors=True)
        try:
            draft.mkdir(parents=True)
            write(draft)
            files = Files()
            for path in sorted(draft.rglob("*")):
                if path.is_dir():
                    files.sync_folder(path)
                else:
                    files.sync(path)
            files.sync_folder(draft)
            files.replace(draft, final)
            files.sync_folder(folder)
        except OSError as error:
            shutil.rmtree(draft, ignore_errors=True)
            raise unwritable(final, error, f", and {self.then}") from error
        for old in self.checkpoints()[:-KEPT]:
            with contextlib.suppress(OSError):  # it only takes space
                discard(old)
        return final


def discard(folder: Path) -> None:
    """Remove a folder; until then, whatever has its name is complete. Raises OSError.

    What a kill leaves has another name, see ``leftovers``.
    """
    hidden = folder
    if not is_leftover(folder):
        hidden = folder.with_name(f".{folder.name}.part")
        shutil.rmtree(hidden, ignore_errors=True)
        folder.rename(hidden)
    if (hidden / "run.json").exists():  # it shows what this was, until nothing else is left
        for path in hidden.iterdir():
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            elif path.name != "run.json":
                path.unlink()
    shutil.rmtree(hidden)


def is_leftover(folder: Path) -> bool:
    """Return whether a folder is what a kill has left of a removal, or of a checkpoint that was written."""
    found = _LEFTOVER.fullmatch(folder.name)
    if found is None or folder.is_symlink() or not folder.is_dir():
        return False
    is_checkpoint = _CHECKPOINT.fullmatch(found[1]) is not None
    return is_checkpoint or (folder / "run.json").is_file() or not any(folder.iterdir())


def leftovers(folder: Path) -> list[Path]:
    """Return what kills have left in a folder of runs or of checkpoints."""
    return sorted(path for path in folder.glob(".*.part") if is_leftover(path))


def refuse_other(before: Mapping[str, Any], wanted: Mapping[str, Any], free: Collection[str]) -> None:
    """Refuse to continue a run with settings other than those of its start.

    Args:
        before: the facts of the run; wanted: those of the file; ``settings`` of both are compared one by one.
        free: settings that may change.

    Raises:
        RunError: a setting differs, or an older version did not write it; names the first.
    """
    own, other = kind_of(before), kind_of(wanted)
    if other and own != other:
        raise RunError(
            f"the run is {own or 'of unknown kind'}, not {other}: name another one in resume_run, or start a "
            "new one"
        )
    unimportant = ("settings", "tracking", "cluster", "cluster_workers", *free)
    old = {**before, **before.get("settings", {})}
    new = {**wanted, **wanted.get("settings", {})}
    for key, value in new.items():
        if key not in unimportant and not _is_same(old.get(key), value):
            if key not in old:
                place = '"settings" in run.json' if key in wanted.get("settings", {}) else "run.json"
                raise RunError(
                    f"an older version started the run and did not record {key}, but the file says {value}: "
                    f'if that is how the run was started, add "{key}": {json.dumps(value)} to '
                    f"{place}; otherwise start a new run"
                )
            raise RunError(
                f"the run was started with {key} {old.get(key)}, but the file says {value}: "
                "continue with the settings of the run, or start a new one"
            )


def kind_of(facts: Mapping[str, Any]) -> str:
    """Return what the facts of a run are those of, in words; "" if they do not say it."""
    if facts.get("kind") == "evaluation":
        return "an evaluation"
    if facts.get("method") == "METHOD_IMITATION":
        return "a training by METHOD_IMITATION"
    return "a training by METHOD_RL" if facts.get("environment") else ""


def _without_secrets(value: Any) -> Any:
    """A value for JSON whose texts hide secrets, see ``masked``."""
    if isinstance(value, str):
        return masked(value)
    if isinstance(value, Mapping):
        return {key: _without_secrets(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_secrets(item) for item in value]
    return value


def _is_same(kept: Any, value: Any) -> bool:
    """Return whether a value is the one that a run kept, where hidden parts may be anything."""
    if isinstance(kept, str) and isinstance(value, str) and HIDDEN in kept:
        shown = map(re.escape, kept.split(HIDDEN))
        return re.fullmatch(".+".join(shown), value, re.DOTALL) is not None
    if isinstance(kept, Mapping) and isinstance(value, Mapping):
        return kept.keys() == value.keys() and all(_is_same(kept[key], value[key]) for key in kept)
    if isinstance(kept, list) and isinstance(value, list | tuple):
        return len(kept) == len(value) and all(map(_is_same, kept, value))
    return bool(kept == value)


def described(folder: Path) -> dict[str, Any]:
    """Return versions, machine and the git state of a folder, for ``run.json``."""
    versions = {}
    for name in RECORDED:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return {
        "versions": versions,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "git": _git(folder),
    }


def _git(folder: Path) -> dict[str, Any] | None:
    """Return the commit and whether its files are changed; None outside a repository, or without git."""
    answers = []
    # files that git does not know would make each run after the first a changed one: its own folder is one
    for command in (("rev-parse", "HEAD"), ("status", "--porcelain", "--untracked-files=no")):
        try:
            done = subprocess.run(
                ("git", "-C", str(folder), *command), capture_output=True, text=True, timeout=10, check=True
            )
        except (OSError, subprocess.SubprocessError):
            return None
        answers.append(done.stdout.strip())
    return {"commit": answers[0], "changed": bool(answers[1])}


def _json(path: Path) -> dict[str, Any]:
    try:
        content = parse_json(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RunError(f"{path} cannot be read: {error}: choose another run") from error
    if not isinstance(content, dict):
        raise RunError(f"{path} contains no JSON object: choose another run")
    return content
