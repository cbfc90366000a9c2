"""Read a policy's checkpoint from its files, without torch and without executing any of it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from joshua.features import ACTION, STATE, FeatureSet
from joshua.tools import describe_pointer, parse_json

from joshua_lerobot.normalisation import Normaliser, norm_of, unnormalised
from joshua_lerobot.safetensors import TornFileError, entries, table

CONFIG = "config.json"
WEIGHTS = "model.safetensors"
PREPROCESSOR = "policy_preprocessor.json"
POSTPROCESSOR = "policy_postprocessor.json"
ADAPTER = "adapter_config.json"

#: The ``meta/info.json`` of the data set that a policy was trained on, kept beside its weights.
DATASET = "dataset.json"

#: Files that are unpickled when they are loaded, which executes their content.
PICKLES = (".bin", ".pt", ".pth", ".ckpt", ".pkl", ".pickle")

#: Where LeRobot's training puts a checkpoint below the folder that it writes.
_BELOW = ("pretrained_model", "checkpoints/last/pretrained_model", "last/pretrained_model")


class CheckpointError(Exception):
    """A checkpoint cannot be used.

    Args:
        message: what is wrong with it, one sentence; remedy: what to do, one imperative sentence.
    """

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(f"{message}. {remedy}")
        self.message = message
        self.remedy = remedy


@dataclass(frozen=True)
class PolicyFeature:
    """One input or output of a policy.

    Attributes:
        key: LeRobot's name; kind: STATE, VISUAL, ENV, ACTION or LANGUAGE.
        shape: of one value; pictures are (channels, height, width). 0 stands for any length.
    """

    key: str
    kind: str
    shape: tuple[int, ...]


@dataclass(frozen=True)
class Checkpoint:
    """Description of a checkpoint, from its files.

    Attributes:
        folder: of the files; type: of the policy, such as ``act``; config: of config.json.
        inputs, outputs: features of the policy.
        statistics: of each feature by name, such as ``mean``, flattened.
        norms: how each feature is normalised, such as ``MEAN_STD``; "" if it is not.
        unnormalised: features whose normalisation is declared, but whose statistics are missing, so that
            LeRobot passes their values on as they are.
        dataset: features of the data set that it was trained on, in its units; None if unknown.
        fps: frames per second of that data set; 0 if unknown.
    """

    folder: Path
    type: str
    config: Mapping[str, Any]
    inputs: tuple[PolicyFeature, ...]
    outputs: tuple[PolicyFeature, ...]
    statistics: Mapping[str, Mapping[str, tuple[float, ...]]] = field(default_factory=dict)
    norms: Mapping[str, str] = field(default_factory=dict)
    unnormalised: tuple[str, ...] = ()
    dataset: FeatureSet | None = None
    fps: float = 0.0

    @property
    def cameras(self) -> tuple[PolicyFeature, ...]:
        """Camera inputs of the policy."""
        return tuple(item for item in self.inputs if item.kind == "VISUAL")

    def size(self, key: str) -> int:
        """Return the length of the state or the action; 0 if it has none."""
        return next((item.shape[0] for item in (*self.inputs, *self.outputs) if item.key == key), 0)

    def described(self, key: str) -> tuple[tuple[str, ...], str]:
        """Return the joint names of a feature, without ``.pos``, and their unit; () and "" if unknown."""
        feature = self.dataset.get(key) if self.dataset is not None else None
        if feature is None:
            return (), ""
        return tuple(name.removesuffix(".pos") for name in feature.names), feature.unit


def read_checkpoint(folder: Path, *, weights: str = WEIGHTS) -> Checkpoint:
    """Read a checkpoint.

    Args:
        folder: of the checkpoint; weights: name of the file that must be complete.

    Raises:
        CheckpointError: it cannot be used; none of it was executed.
    """
    config = _config(folder)
    inputs, outputs = (_features(folder, config, side) for side in ("input_features", "output_features"))
    if weights == WEIGHTS:
        _refuse_adapter(folder, config)
        check_weights(folder)
        check_processors(folder)
    before, after = (_normalisers(folder, name) for name in (PREPROCESSOR, POSTPROCESSOR))
    norms = {item.key: norm_of(item, before, config) for item in inputs}
    norms |= {item.key: norm_of(item, after, config) for item in outputs}
    dataset, fps = _dataset(folder)
    return Checkpoint(
        folder=folder,
        type=str(config["type"]),
        config=config,
        inputs=inputs,
        outputs=outputs,
        statistics=_merged([*before, *after]),
        norms=norms,
        unnormalised=unnormalised(inputs, before, config) + unnormalised(outputs, after, config),
        dataset=dataset,
        fps=fps,
    )


def _refuse_adapter(folder: Path, config: Mapping[str, Any]) -> None:
    """Raise CheckpointError for adapters, which PEFT keeps without the policy that they change."""
    is_merged = not config.get("use_peft") and (folder / WEIGHTS).is_file()
    has_adapter = (folder / ADAPTER).is_file()
    if is_merged or not (config.get("use_peft") or has_adapter):
        return
    base = _json(folder / ADAPTER).get("base_model_name_or_path") if has_adapter else None
    raise CheckpointError(
        f"{folder} is an adapter (PEFT), not a complete policy",
        f"Merge it in Python: policy = PeftModel.from_pretrained(BASE, {str(folder)!r}).merge_and_unload(), "
        f"where BASE is the policy that LeRobot loads from {base or 'the checkpoint that was adapted'}; set "
        "policy.config.use_peft = False, call policy.save_pretrained(FOLDER), and copy policy_* there",
    )


def check_weights(folder: Path) -> None:
    """Raise CheckpointError for weights that are missing, truncated or pickled."""
    path = folder / WEIGHTS
    if not path.is_file():
        pickles = sorted(item.name for item in folder.iterdir() if item.suffix in PICKLES)
        if pickles:
            raise pickled(folder, pickles[0])
        raise CheckpointError(
            f"{folder} has no {WEIGHTS}",
            "Save the policy with policy.save_pretrained(FOLDER), and name that folder",
        )
    if (pointer := describe_pointer(path)) is not None:
        raise CheckpointError(*pointer)
    try:
        if not entries(path):
            raise TornFileError(f"{path} contains no weights")
    except TornFileError as error:
        raise CheckpointError(str(error), "Copy or download the checkpoint again") from error
    except OSError as error:
        raise CheckpointError(f"{path} cannot be read: {error.strerror}", "Change its permissions") from error


def pickled(place: Path | str, name: str) -> CheckpointError:
    """Return the error for pickled weights."""
    return CheckpointError(
        f"{place} has its weights in {name}, a pickle, which executes what it contains when it is loaded; "
        f"only {WEIGHTS} is loaded",
        "If you trust it, convert it once on a machine that is not the robot: load it with the LeRobot that "
        "wrote it, and call policy.save_pretrained(FOLDER)",
    )


def check_processors(folder: Path) -> None:
    """Raise CheckpointError for processors that are missing, or that name code outside of LeRobot."""
    for name in (PREPROCESSOR, POSTPROCESSOR):
        if not (folder / name).is_file():
            raise CheckpointError(
                f"{folder} has no {name}: it was written before LeRobot 0.4 and keeps its normalisation in "
                "the weights",
                "Convert it: python -m lerobot.processor.migrate_policy_normalization --pretrained-path "
                f"{folder}",
            )
        for step in _steps(folder / name):
            place = step.get("class", "")
            if "registry_name" not in step and not str(place).startswith("lerobot."):
                raise CheckpointError(
                    f"{folder / name} names {place or 'no class'} as a processor: loading it would execute "
                    "code that is not LeRobot's",
                    "Save the checkpoint with LeRobot's own processors",
                )
            _check_state(folder, str(step.get("state_file") or ""))


def _check_state(folder: Path, name: str) -> None:
    if not name:
        return
    path = folder / name
    if Path(name).name != name or path.suffix != ".safetensors":
        raise CheckpointError(
            f"{folder} keeps statistics in {name!r}, and only a .safetensors file beside it is loaded",
            "Save the checkpoint again with policy and processors",
        )
    if not path.is_file():
        raise CheckpointError(f"{path} is missing", "Copy or download the whole checkpoint again")
    if (pointer := describe_pointer(path)) is not None:
        raise CheckpointError(*pointer)
    try:
        entries(path)
    except TornFileError as error:
        raise CheckpointError(str(error), "Copy or download the checkpoint again") from error


def _config(folder: Path) -> dict[str, Any]:
    if not folder.is_dir():
        what = "is a file, but a checkpoint is a folder" if folder.exists() else "does not exist"
        raise CheckpointError(f"{folder} {what}", f"Name the folder that holds {CONFIG} and {WEIGHTS}")
    path = folder / CONFIG
    if not path.is_file():
        inner = next((name for name in _BELOW if (folder / name / CONFIG).is_file()), "")
        if inner:
            raise CheckpointError(f"{folder} has no {CONFIG}", f"Name its folder {folder / inner}")
        pickles = sorted(item.name for item in folder.iterdir() if item.suffix in PICKLES)
        if pickles:
            raise pickled(folder, pickles[0])
        raise CheckpointError(
            f"{folder} has no {CONFIG}", "Name the folder that policy.save_pretrained or lerobot-train wrote"
        )
    config = _json(path)
    if not isinstance(config.get("type"), str):
        kind = "a model of transformers" if "architectures" in config else "not a policy of LeRobot"
        raise CheckpointError(
            f"{path} names no type of policy: it describes {kind}", "Name a checkpoint that LeRobot wrote"
        )
    return config


def _features(folder: Path, config: Mapping[str, Any], side: str) -> tuple[PolicyFeature, ...]:
    try:
        described = config.get(side) or {}
        return tuple(
            PolicyFeature(key, str(values["type"]), tuple(map(int, values["shape"])))
            for key, values in described.items()
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise CheckpointError(
            f"{folder / CONFIG}: {side} is not a description of features", "Save the checkpoint again"
        ) from error


def _json(path: Path) -> dict[str, Any]:
    try:
        content = parse_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise CheckpointError(f"{path} cannot be read: {error.strerror}", "Change its permissions") from error
    except ValueError as error:
        raise CheckpointError(
            f"{path} is not JSON: {error}", "Copy or download the checkpoint again"
        ) from error
    if not isinstance(content, dict):
        raise CheckpointError(f"{path} is not a JSON object", "Copy or download the checkpoint again")
    return content


def _steps(path: Path) -> Iterator[Mapping[str, Any]]:
    for step in _json(path).get("steps") or ():
        if isinstance(step, Mapping):
            yield step


def _normalisers(folder: Path, name: str) -> list[Normaliser]:
    """Return the steps of a processor that normalise, with their statistics. Raises CheckpointError."""
    found = []
    for step in _steps(folder / name) if (folder / name).is_file() else ():
        config = step.get("config")
        if not isinstance(config, Mapping) or "norm_map" not in config:
            continue
        state = str(step.get("state_file") or "")
        statistics: dict[str, dict[str, tuple[float, ...]]] = {}
        if state and (folder / state).is_file():
            try:
                numbers = table(folder / state)
            except TornFileError as error:
                raise CheckpointError(str(error), "Copy or download the checkpoint again") from error
            for path, values in numbers.items():
                key, _, statistic = path.rpartition(".")
                statistics.setdefault(key, {})[statistic] = values
        normaliser = Normaliser.of(config, statistics)
        if normaliser is not None:
            found.append(normaliser)
    return found


def _merged(normalisers: Sequence[Normaliser]) -> dict[str, dict[str, tuple[float, ...]]]:
    """Return the statistics of several steps; a later step replaces those of an earlier one."""
    found: dict[str, dict[str, tuple[float, ...]]] = {}
    for normaliser in normalisers:
        for key, values in normaliser.statistics.items():
            found.setdefault(key, {}).update(values)
    return found


def _dataset(folder: Path) -> tuple[FeatureSet | None, float]:
    """Return the training data set: beside the weights, else where LeRobot's training says it was."""
    info = _json(folder / DATASET) if (folder / DATASET).is_file() else _trained_on(folder)
    try:
        return (FeatureSet.from_lerobot(info["features"]) if info else None), float(info.get("fps") or 0)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise CheckpointError(
            f"{folder / DATASET} does not describe a data set: {error}",
            "Copy meta/info.json of the data set there, or remove the file",
        ) from error


def _trained_on(folder: Path) -> dict[str, Any]:
    """Return ``meta/info.json`` of the data set in ``train_config.json``, if it is on this machine."""
    try:
        named = parse_json((folder / "train_config.json").read_text(encoding="utf-8"))["dataset"]
        home = os.environ.get("HF_LEROBOT_HOME") or "~/.cache/huggingface/lerobot"
        place = Path(named.get("root") or Path(home).expanduser() / str(named["repo_id"]))
        content = parse_json((place / "meta" / "info.json").read_text(encoding="utf-8"))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}
    return content if isinstance(content, dict) and "features" in content else {}


def extent(checkpoint: Checkpoint) -> float:
    """Return the largest position of a joint in the statistics of state and action; 0 if there are none."""
    found = [0.0]
    for key in (STATE, ACTION):
        values = checkpoint.statistics.get(key, {})
        found += [
            abs(value) for name in ("min", "max", "q01", "q99", "mean") for value in values.get(name, ())
        ]
        found += [2 * abs(value) for value in values.get("std", ())]
    return max(found)
