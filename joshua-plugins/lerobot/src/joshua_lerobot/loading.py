"""Load a policy from the files of a checkpoint; only this module imports torch and LeRobot."""

from __future__ import annotations

import importlib
import sys
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from joshua.api import ModelError
from joshua.api.models import Compute

from joshua_lerobot.checkpoint import POSTPROCESSOR, PREPROCESSOR, WEIGHTS, Checkpoint
from joshua_lerobot.settings import DENOISING, PolicySettings, environment

#: Texts of allocators: of PyTorch for the processor and for CUDA, and of onnxruntime.
_NO_MEMORY = ("allocate memory", "not enough memory", "out of memory", "bad_alloc", "bad allocation")

HALF = {"bfloat16": "bfloat16", "float16": "float16"}


@dataclass(frozen=True)
class LoadedPolicy:
    """A policy with its own pre- and post-processors.

    Attributes:
        policy: LeRobot's; before, after: the processors; device: torch's.
        dtype: half precision, None for float32.
    """

    policy: Any
    before: Any
    after: Any
    device: Any
    dtype: Any = None

    def precision(self) -> AbstractContextManager[Any]:
        """Return the context for the policy's precision."""
        import torch

        return torch.autocast(self.device.type, self.dtype) if self.dtype is not None else nullcontext()


class LibraryMissing(ModelError):
    """A library that a model runs on is not installed."""

    exit_code = 3


def require(module: str, what: str) -> Any:
    """Import a module. Raises LibraryMissing with the remedy."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        missing = error.name or module
        raise LibraryMissing(
            f"{what} requires {missing}, which is not installed for {sys.executable}. {environment()}"
        ) from error
    except (ImportError, OSError, RuntimeError) as error:
        raise LibraryMissing(
            f"{what} requires {module}, which {sys.executable} cannot import: {error}. {environment()}"
        ) from error


def choose_device(wanted: str) -> Any:
    """Return torch's device for the device of the file. Raises ModelError if it does not exist."""
    torch = require("torch", "A policy")
    there = {"cuda": torch.cuda.is_available(), "mps": torch.backends.mps.is_available(), "cpu": True}
    if wanted == "auto":
        return torch.device(next(name for name, is_there in there.items() if is_there))
    if not there[wanted]:
        found = ", ".join(name for name, is_there in there.items() if is_there)
        why = {
            "cuda": "Install the driver of the GPU and a PyTorch that is built for CUDA",
            "mps": "It needs macOS on Apple silicon",
        }[wanted]
        raise ModelError(
            f'device: "{wanted}" is not available; PyTorch {torch.__version__} of {sys.executable} finds '
            f"{found}. {why}, "
            'or set compute { device: "auto" }'
        )
    return torch.device(wanted)


def prepare(compute: Compute) -> Any:
    """Set threads and choose the device. Raises ModelError."""
    torch = require("torch", "A policy")
    if compute.threads:
        torch.set_num_threads(compute.threads)
    return choose_device(compute.device)


def load_policy(checkpoint: Checkpoint, settings: PolicySettings) -> LoadedPolicy:
    """Load a policy and its processors.

    Raises:
        ModelError: a library, a device or a part of the checkpoint is missing or does not fit.
    """
    device = prepare(settings.compute)
    import torch

    require("lerobot", "A policy")
    config = _config(checkpoint, settings, device)
    dtype = getattr(torch, HALF[settings.compute.precision]) if settings.compute.precision in HALF else None
    try:
        policy = _policy(checkpoint, config, device)
        if dtype is not None:
            policy.to(dtype)
        policy.to(device)
        policy.eval()
        if settings.compile and not hasattr(config, "compile_model"):
            if not hasattr(policy, "model"):
                raise ModelError(
                    f"Policies of type {checkpoint.type} cannot be compiled. Remove compile: true"
                )
            policy.model = torch.compile(policy.model)
        before, after = _processors(checkpoint, config, device)
    except (MemoryError, RuntimeError) as error:
        if lacks_memory(error):
            raise out_of_memory(device) from error
        raise
    return LoadedPolicy(policy, before, after, device, dtype)


def lacks_memory(error: BaseException) -> bool:
    """Whether an error says that the memory of a device or of this machine is too small for a policy."""
    if isinstance(error, MemoryError) or type(error).__name__ == "OutOfMemoryError":
        return True
    return any(text in str(error) for text in _NO_MEMORY)  # no type of its own


def out_of_memory(device: Any) -> ModelError:
    """Return what to do without enough memory."""
    return ModelError(
        f'The memory of {device} is too small for the policy. Set compute {{ precision: "bfloat16" }}, '
        "which needs half, lower picture_size, or end other programs that use it"
    )


def not_compiled(error: Exception) -> ModelError:
    """Return what to do if torch.compile fails."""
    said = str(error).strip().partition("\n")[0]
    return ModelError(
        f"The policy could not be compiled: {said}. Install a C++ compiler (on Debian: g++), "
        "or remove compile: true"
    )


def _config(checkpoint: Checkpoint, settings: PolicySettings, device: Any) -> Any:
    require("lerobot.policies", f"A policy of type {checkpoint.type!r}")
    import draccus
    from lerobot.configs.policies import PreTrainedConfig

    known = sorted(PreTrainedConfig.get_known_choices())
    if checkpoint.type not in known:
        raise ModelError(
            f"{checkpoint.folder} holds a policy of type {checkpoint.type!r}, which this LeRobot does not "
            "have; it has "
            f"{', '.join(known)}. Install the version of LeRobot that trained it"
        )
    values = dict(checkpoint.config)
    chosen = {
        "device": str(device),
        "load_vlm_weights": False,  # they are in the checkpoint
        "pretrained_backbone_weights": None,
        "use_amp": False,
        "push_to_hub": False,
    }
    if settings.compile:
        chosen["compile_model"] = True
    if settings.denoising_steps:
        chosen[DENOISING[checkpoint.type]] = settings.denoising_steps
    if settings.picture_size:
        chosen["resize_imgs_with_padding"] = [settings.picture_size, settings.picture_size]
    if inner := inner_folder(checkpoint):
        chosen["vlm_model_name"] = str(inner)
    values |= {name: value for name, value in chosen.items() if name in values or name in ("device",)}
    try:
        with draccus.config_type("json"):
            return draccus.decode(PreTrainedConfig, values)
    except Exception as error:
        said = str(error).strip().partition("\n")[0]
        raise ModelError(
            f"{checkpoint.folder / 'config.json'} does not fit this LeRobot: {said}. Install the version "
            "that trained "
            "the policy, or save it again with this one"
        ) from error


def inner_folder(checkpoint: Checkpoint) -> Path | None:
    """Return the folder of the language model's description; None if its name is not that of a folder.

    LeRobot requires an absolute path. A folder of its name in the checkpoint comes first, because the
    checkpoint may have been moved.
    """
    name = Path(str(checkpoint.config.get("vlm_model_name") or ""))
    places = (checkpoint.folder / name.name, name) if name.is_absolute() else (checkpoint.folder / name,)
    return next((place for place in places if name.name and (place / "config.json").is_file()), None)


def _policy(checkpoint: Checkpoint, config: Any, device: Any) -> Any:
    from lerobot.policies.factory import get_policy_class
    from lerobot.policies.pretrained import PreTrainedPolicy
    from safetensors.torch import load_model

    what = f"A policy of type {checkpoint.type!r}"
    try:
        kind = get_policy_class(checkpoint.type)
        if kind.from_pretrained.__func__ is not PreTrainedPolicy.from_pretrained.__func__:
            return kind.from_pretrained(checkpoint.folder, config=config)  # it renames its weights
        policy = kind(config)
    except ModuleNotFoundError as error:
        raise ModelError(
            f"{what} requires {error.name}, which is not installed for {sys.executable}: pip install "
            f"{error.name}"
        ) from error
    except OSError as error:  # transformers: a part of the language model is missing
        raise _without_language_model(checkpoint, error) from error
    except (ImportError, ValueError, TypeError, RuntimeError, AssertionError) as error:
        if lacks_memory(error):
            raise
        raise ModelError(
            f"{what} cannot be made from {checkpoint.folder / 'config.json'}: {error}"
        ) from error
    try:
        missing, unexpected = load_model(
            policy, checkpoint.folder / WEIGHTS, strict=False, device=str(device)
        )
    except RuntimeError as error:
        if lacks_memory(error):
            raise
        said = " ".join(str(error).split())[:300]
        raise ModelError(
            f"{checkpoint.folder / WEIGHTS} does not fit config.json beside it: {said}. Copy both from one "
            "checkpoint"
        ) from error
    if missing:
        raise ModelError(
            f"{checkpoint.folder / WEIGHTS} lacks {len(missing)} weights of the policy, such as "
            f"{min(missing)}, which "
            "would be random. Copy config.json and the weights from one checkpoint"
        )
    if any(name.startswith(("normalize_", "unnormalize_")) for name in unexpected):
        raise ModelError(
            f"{checkpoint.folder} keeps its normalisation in the weights. Convert it: python -m "
            f"lerobot.processor.migrate_policy_normalization --pretrained-path {checkpoint.folder}"
        )
    return policy


def _without_language_model(checkpoint: Checkpoint, error: Exception) -> ModelError:
    name = checkpoint.config.get("vlm_model_name") or "the language model"
    said = str(error).strip().partition("\n")[0][:200]
    return ModelError(
        f"{checkpoint.folder} builds on {name}, whose description and tokenizer cannot be loaded: {said}. "
        "Connect this "
        f"machine once and run `joshua policy fetch {checkpoint.folder}`, or copy them into a folder of the "
        "checkpoint and name that in vlm_model_name of config.json"
    )


def _processors(checkpoint: Checkpoint, config: Any, device: Any) -> tuple[Any, Any]:
    from lerobot.policies.factory import make_pre_post_processors

    before: dict[str, Any] = {"device_processor": {"device": str(device)}}
    if inner := inner_folder(checkpoint):
        before["tokenizer_processor"] = {"tokenizer_name": str(inner)}
    chosen = {
        "preprocessor_overrides": before,
        "postprocessor_overrides": {"device_processor": {"device": "cpu"}},
    }
    for side, name in zip(chosen, (PREPROCESSOR, POSTPROCESSOR), strict=True):
        text = (checkpoint.folder / name).read_text(encoding="utf-8")
        chosen[side] = {step: values for step, values in chosen[side].items() if f'"{step}"' in text}
    try:
        before_policy, after_policy = make_pre_post_processors(config, str(checkpoint.folder), **chosen)
    except OSError as error:
        raise _without_language_model(checkpoint, error) from error
    except (ImportError, KeyError, ValueError, TypeError, RuntimeError) as error:
        said = " ".join(str(error).split())[:300]
        raise ModelError(f"The processors of {checkpoint.folder} cannot be loaded: {said}") from error
    return before_policy, after_policy
