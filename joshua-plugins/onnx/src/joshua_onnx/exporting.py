"""Export policies to ONNX: the network with its normalisation, verified against the policy itself."""

from __future__ import annotations

import json
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from joshua.api.models import Compute
from joshua.features import ACTION
from joshua.tools import parse_json
from joshua_lerobot.checkpoint import (
    CONFIG,
    DATASET,
    WEIGHTS,
    Checkpoint,
    CheckpointError,
    check_weights,
    read_checkpoint,
)
from joshua_lerobot.loading import LoadedPolicy, load_policy, prepare, require
from joshua_lerobot.settings import LeRobotSettings

from joshua_onnx.model import open_session
from joshua_onnx.ppo import export_trained, is_trained_here
from joshua_onnx.settings import EXPORTED, NETWORK

#: Policies that can be exported: one observation in, one chunk out, nothing random.
EXPORTABLE = ("act", "mlp")

#: Largest difference between a policy and its export, in the units of its actions.
LARGEST_DIFFERENCE = 1e-4

#: Steps of a checkpoint's processors that do not affect an exported policy, or become part of it.
_STEPS = {
    "rename_observations_processor",
    "to_batch_processor",
    "device_processor",
    "normalizer_processor",
    "unnormalizer_processor",
}


def export(folder: Path, target: Path) -> Iterator[str]:
    """Write a policy as ONNX into a folder, and yield what was written.

    Raises:
        CheckpointError: it cannot be exported, or the target is not empty.
        ModelError: a library is missing, or the checkpoint cannot be loaded.
    """
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise CheckpointError(f"{target} is not empty, and nothing is overwritten", "Name another folder")
    if is_trained_here(folder):
        yield from export_trained(folder, target)
        return
    is_mlp = _type_of(folder) == "mlp"
    checkpoint = read_checkpoint(folder, weights=NETWORK if is_mlp else WEIGHTS)
    if checkpoint.type not in EXPORTABLE:
        raise CheckpointError(
            f"{folder} holds a policy of type {checkpoint.type!r}; only {' and '.join(EXPORTABLE)} can",
            "Run it with [joshua/joshua.LeRobotPolicy]",
        )
    check_weights(folder)
    prepare(Compute(device="cpu"))
    require("onnx", "Exporting a policy")
    policy = _mlp(checkpoint) if is_mlp else _act(checkpoint)
    with tempfile.TemporaryDirectory(prefix="joshua-export-") as scratch:
        made = Path(scratch)
        network = _traced(policy, _inputs(checkpoint, seed=0), made / NETWORK)
        difference = _difference(policy, network, checkpoint)
        if not difference <= LARGEST_DIFFERENCE:
            raise CheckpointError(
                f"The exported policy differs from {folder} by {difference:.3g}, more than "
                f"{LARGEST_DIFFERENCE:g}",
                "Run the checkpoint itself, and report this",
            )
        for path in folder.iterdir():
            if path.suffix in (".json", ".safetensors") and path.name not in (WEIGHTS, CONFIG):
                shutil.copy(path, made / path.name)
        described = {"bytes": len(network), "exported_from": checkpoint.type}
        config = {**checkpoint.config, EXPORTED: described}
        (made / CONFIG).write_text(json.dumps(config, indent=2), encoding="utf-8")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(made, target, dirs_exist_ok=True)
    yield f"{target / NETWORK}: {len(network) / 1e6:.3g} MB, largest difference {difference:.1e}"
    if not (folder / DATASET).is_file():
        yield f"no {DATASET} beside the policy: names, unit and rate of its joints are not checked"


def _type_of(folder: Path) -> str:
    try:
        return str(parse_json((folder / CONFIG).read_text(encoding="utf-8"))["type"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""  # reading the checkpoint reports why


def _inputs(checkpoint: Checkpoint, seed: int) -> dict[str, Any]:
    """Return a random observation in the form of the exported policy's input."""
    draw = np.random.default_rng(seed)
    values: dict[str, Any] = {}
    for item in checkpoint.inputs:
        if item.kind == "VISUAL":
            channels, height, width = item.shape
            values[item.key] = draw.integers(0, 255, (1, height, width, channels), np.uint8)
        else:
            values[item.key] = draw.normal(0, 1, (1, *item.shape)).astype(np.float32)
    return values


def _traced(policy: Callable[[dict[str, Any]], Any], values: dict[str, Any], path: Path) -> bytes:
    import torch

    class Network(torch.nn.Module):  # type: ignore[misc]  # torch is not installed where types are checked
        """Policy as a function of its inputs in their order."""

        def forward(self, *inputs: Any) -> Any:
            return policy(dict(zip(values, inputs, strict=True)))

    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")  # of the tracer, about branches that depend on sizes only
        torch.onnx.export(
            Network().eval(),
            tuple(torch.from_numpy(value) for value in values.values()),
            str(path),
            input_names=list(values),
            output_names=[ACTION],
            opset_version=17,
            dynamo=False,  # the other exporter requires another library, and its networks are not faster
        )
    return path.read_bytes()


def _difference(policy: Callable[[dict[str, Any]], Any], network: bytes, checkpoint: Checkpoint) -> float:
    """Return the largest difference between some chunks."""
    import torch

    session = open_session(network, Compute(device="cpu"), NETWORK)
    found = 0.0
    for seed in range(1, 4):
        values = _inputs(checkpoint, seed)
        with torch.no_grad():
            wanted = policy({key: torch.from_numpy(value) for key, value in values.items()})
        given = session.run([ACTION], values)[0]
        found = max(found, float(np.abs(given - wanted.numpy()).max()))
    return found


def _act(checkpoint: Checkpoint) -> Callable[[dict[str, Any]], Any]:
    """Return ACT with the normalisation of its checkpoint as one function."""
    settings = LeRobotSettings(weights=str(checkpoint.folder), compute=Compute(device="cpu"))
    loaded = load_policy(checkpoint, settings)
    loaded.policy.requires_grad_(False)  # weights become constants of the network
    for step in (*loaded.before.steps, *loaded.after.steps):
        name = getattr(type(step), "_registry_name", type(step).__name__)
        if name not in _STEPS or getattr(step, "rename_map", None):
            raise CheckpointError(
                f"{checkpoint.folder} has the processor {name}, which cannot become a part of the network",
                "Run it with [joshua/joshua.LeRobotPolicy]",
            )
    pictures = {item.key for item in checkpoint.cameras}
    kept = int(checkpoint.config.get("n_action_steps") or 0) or None

    def policy(values: dict[str, Any]) -> Any:
        seen = {
            key: (value.permute(0, 3, 1, 2).float() / 255 if key in pictures else value)
            for key, value in values.items()
        }
        chunk = loaded.policy.predict_action_chunk(_applied(loaded, seen, "observation"))
        return _applied(loaded, chunk[:, :kept], "action")

    return policy


def _applied(loaded: LoadedPolicy, value: Any, part: str) -> Any:
    """Apply the normalisers to an observation, or to actions on their way out."""
    from lerobot.processor import NormalizerProcessorStep, TransitionKey, UnnormalizerProcessorStep
    from lerobot.processor.converters import create_transition

    is_action = part == "action"
    kind: Any = UnnormalizerProcessorStep if is_action else NormalizerProcessorStep
    key = TransitionKey.ACTION if is_action else TransitionKey.OBSERVATION
    for step in (loaded.after if is_action else loaded.before).steps:
        if isinstance(step, kind):
            value = step(create_transition(**{part: value}))[key]
    return value


def _mlp(checkpoint: Checkpoint) -> Callable[[dict[str, Any]], Any]:
    """Return a network of fully connected layers as one function; actions have the shape (1, 1, N)."""
    import torch
    from safetensors.torch import load_file

    weights, config = load_file(checkpoint.folder / WEIGHTS), checkpoint.config
    activations = {"tanh": torch.tanh, "relu": torch.relu, "elu": torch.nn.functional.elu}
    chosen = str(config.get("activation") or "tanh")
    count = sum(name.startswith("layers.") and name.endswith(".weight") for name in weights)
    if chosen not in activations or not count or f"layers.{count - 1}.bias" not in weights:
        raise CheckpointError(
            f"{checkpoint.folder} is not a network of layers.0 to layers.N with the activation "
            f"{', '.join(activations)}",
            "Save it as the guide “Models” says",
        )
    clip, low, high = (config.get(name) for name in ("clip_observation", "action_low", "action_high"))

    def policy(values: dict[str, Any]) -> Any:
        x = torch.cat([value.flatten(1) for value in values.values()], dim=1)
        if "observation.mean" in weights:
            x = (x - weights["observation.mean"]) / weights["observation.std"]
        if clip:
            x = x.clamp(-float(clip), float(clip))
        for i in range(count):
            x = torch.nn.functional.linear(x, weights[f"layers.{i}.weight"], weights[f"layers.{i}.bias"])
            x = activations[chosen](x) if i < count - 1 else x
        if config.get("squash"):
            x = torch.tanh(x)
        if low and high:
            x = torch.maximum(torch.minimum(x, torch.tensor(high)), torch.tensor(low))
        if "action.scale" in weights:
            x = x * weights["action.scale"] + weights["action.offset"]
        return x[:, None]

    return policy
