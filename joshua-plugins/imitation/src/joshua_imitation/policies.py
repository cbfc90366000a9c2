"""LeRobot's policies for a data set: network, optimiser and processors from the settings."""

from __future__ import annotations

import copy
import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from joshua.tools import parse_json
from joshua_dataset.reader import Dataset
from joshua_lerobot.checkpoint import CONFIG, DATASET, PREPROCESSOR, Checkpoint, CheckpointError
from joshua_lerobot.hub import fetch
from joshua_lerobot.loading import inner_folder
from joshua_training.memory import is_out_of_memory, remedied
from joshua_training.run_folder import LibraryMissing, RunError

from joshua_imitation.batch_norm import learn_batch_norm
from joshua_imitation.data import Windows
from joshua_imitation.settings import ImitationSettings
from joshua_imitation.start import read_start
from joshua_imitation.statistics import statistics

_BACKBONE = "ResNet18_Weights.IMAGENET1K_V1"

#: What to do without a setting that needs less memory.
MORE_MEMORY = "end other programs, or train on a machine with more memory"

#: Folder of a checkpoint with the description and the tokenizer of its language model.
LANGUAGE_MODEL = "vlm"

#: Most updates in which a cosine schedule rises.
_MOST_WARM_UP = 500


@dataclass
class Parts:
    """Parts of a training.

    Attributes:
        policy: LeRobot's, perhaps wrapped by adapters; before, after: its processors.
        config: of the policy; optimiser, schedule: the latter None for a constant step size.
        max_norm: of the gradient; windows: that it learns from; drop_last: frames at the end of episodes.
        inner: folder of the language model's description, None without one.
    """

    policy: Any
    before: Any
    after: Any
    config: Any
    optimiser: torch.optim.Optimizer
    schedule: Any
    max_norm: float
    windows: Windows
    drop_last: int
    inner: Path | None = None
    adapters: bool = False


def make_config(
    settings: ImitationSettings, dataset: Dataset, sizes: Mapping[str, tuple[int, int]], device: str
) -> tuple[Any, Path | None, Path | None]:
    """Return the policy's configuration, the folder of its initial checkpoint, and its language model's.

    Raises:
        RunError: the settings or the checkpoint do not fit the data set.
    """
    import draccus
    from lerobot.configs.policies import PreTrainedConfig
    from lerobot.configs.types import FeatureType
    from lerobot.datasets.utils import dataset_to_policy_features

    known = dataset_to_policy_features(
        {
            key: values
            for key, values in dataset.info["features"].items()
            if key.startswith(("observation.", "action"))
        }
    )
    outputs = {key: feature for key, feature in known.items() if key == "action"}
    inputs = {}
    for key, feature in known.items():
        if feature.type is FeatureType.VISUAL and key in sizes:
            inputs[key] = type(feature)(feature.type, (3, *sizes[key]))
        elif key in ("observation.state", "observation.environment_state"):
            inputs[key] = type(feature)(feature.type, tuple(feature.shape))
    outputs = {key: type(value)(value.type, tuple(value.shape)) for key, value in outputs.items()}
    values: dict[str, Any] = {"type": settings.policy_type}
    start: Path | None = None
    inner: Path | None = None
    if settings.pretrained:
        found = _start(settings, dataset)
        start, values, inner = found.folder, dict(found.config), inner_folder(found)
        if inner is not None:
            values |= {"vlm_model_name": str(inner), "load_vlm_weights": False}
    for problem in settings.executed_problems(values):
        raise RunError(f"{problem}: {problem.remedy}")
    values |= _chosen(settings, values) | {"device": device, "push_to_hub": False, "use_amp": False}
    for name in ("input_features", "output_features"):
        values.pop(name, None)
    try:
        with draccus.config_type("json"):
            config = draccus.decode(PreTrainedConfig, values)
        config.input_features, config.output_features = inputs, outputs
        config.validate_features()
    except Exception as error:
        said = str(_cause(error)).strip().partition("\n")[0]
        raise RunError(
            f"{settings.policy_type} cannot learn from {dataset.folder} with these settings: {said}: change "
            "the setting that this names"
        ) from error
    return config, start, inner


def _cause(error: BaseException) -> BaseException:
    """Return the first error of a chain, which says more than that a class cannot be made."""
    return error if error.__cause__ is None else _cause(error.__cause__)


def _start(settings: ImitationSettings, dataset: Dataset) -> Checkpoint:
    """Return the checkpoint to start from."""
    try:
        folder = Path(settings.pretrained)
        if not folder.is_dir():
            folder = fetch(settings.pretrained)
        return read_start(folder, settings.policy_type, settings.dataset, dataset.info["features"])
    except CheckpointError as error:
        raise RunError(f"pretrained: {error}") from error


def _chosen(settings: ImitationSettings, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of the policy's configuration that the file sets."""
    policy = settings.policy_type
    chosen: dict[str, Any] = {"optimizer_lr": settings.learning_rate}
    if settings.weight_decay is not None:
        chosen["optimizer_weight_decay"] = settings.weight_decay
    chunk = settings.chunk_size
    if policy == "diffusion":
        if (width := settings.hidden_size) is not None:
            chosen["down_dims"] = [width, 2 * width, 4 * width]
        if chunk is not None or settings.actions_per_chunk is not None:
            horizon, past = settings.diffusion_window(values)
            most = horizon - past + 1
            actions = settings.actions_per_chunk or min(max(1, horizon // 2), most)
            chosen |= {"horizon": horizon, "n_action_steps": actions, "drop_n_last_frames": most - actions}
    else:
        if chunk is not None:
            chosen |= {"chunk_size": chunk, "n_action_steps": chunk}
        if settings.actions_per_chunk is not None:
            chosen["n_action_steps"] = settings.actions_per_chunk
    if policy in ("act", "diffusion") and not settings.pretrained:
        chosen["pretrained_backbone_weights"] = _BACKBONE if settings.pretrained_backbone else None
        if policy == "diffusion" and settings.pretrained_backbone:
            chosen["use_group_norm"] = False  # the weights are those of a network with batch norm
    if policy == "act":
        chosen["optimizer_lr_backbone"] = settings.backbone_learning_rate or settings.learning_rate
        own = {
            "dim_model": settings.hidden_size,
            "dim_feedforward": settings.feedforward_size,
            "n_encoder_layers": settings.encoder_layers,
            "use_vae": settings.use_vae,
        }
        chosen |= {name: value for name, value in own.items() if value is not None}
    return chosen


def _smaller(settings: ImitationSettings, config: Any) -> str:
    """Say what makes a network smaller that does not fit into the memory."""
    if settings.pretrained:
        return f"name a smaller checkpoint in pretrained, or {MORE_MEMORY}"
    widths = {"hidden_size": getattr(config, "dim_model", None) or config.down_dims[0]}
    if settings.policy_type == "act":
        widths["feedforward_size"] = config.dim_feedforward
    halved = " and ".join(f"{name}: {max(16, width // 16 * 8)}" for name, width in widths.items())
    return f"set {halved}, which needs about a quarter of the memory for the network"


def make_parts(
    settings: ImitationSettings,
    dataset: Dataset,
    sizes: Mapping[str, tuple[int, int]],
    device: str,
    steps: Callable[[int], int],
    continued: Path | None = None,
) -> Parts:
    """Make everything that is trained.

    Args:
        sizes: (height, width) of pictures by key; steps: of the whole training, given how many frames
            at the end of each episode are left out.
        continued: folder of the policy of the run to continue, whose weights are loaded.

    Raises:
        RunError: settings, data set or checkpoint do not fit; LibraryMissing.
    """
    from lerobot.policies.factory import make_pre_post_processors

    config, start, inner = make_config(settings, dataset, sizes, device)
    with remedied(_smaller(settings, config) if continued is None else MORE_MEMORY):
        policy = _policy(settings, dataset, config, start, continued)
        if settings.lora_rank:
            policy = _adapted(policy, settings, start)
        elif settings.policy_type == "act" and not settings.pretrained and not settings.pretrained_backbone:
            learn_batch_norm(policy)
        policy.to(device)
    if settings.loss == "l1" and settings.policy_type == "diffusion":
        _learn_by_l1(policy)
    known = statistics(dataset, sizes, settings.pretrained_backbone, continued or start)
    before, after = make_pre_post_processors(config, dataset_stats=known)
    preset = config.get_optimizer_preset()
    base = policy.base_model.model if settings.lora_rank else policy
    parameters: Any = (
        [p for p in policy.parameters() if p.requires_grad] if settings.lora_rank else base.get_optim_params()
    )
    optimiser = preset.build(parameters)
    if device == "cpu" and isinstance(optimiser, torch.optim.Adam):
        for group in optimiser.param_groups:
            group["fused"] = True  # one pass over the weights instead of one for each operation
    drop_last = int(getattr(config, "drop_n_last_frames", 0))
    last = max(1, steps(drop_last))
    shape = _schedule(settings, config, last)
    schedule = shape.build(optimiser, last) if shape is not None else None
    indices = config.observation_delta_indices
    return Parts(
        policy=policy,
        before=before,
        after=after,
        config=config,
        optimiser=optimiser,
        schedule=schedule,
        max_norm=settings.max_grad_norm or float(preset.grad_clip_norm),
        windows=Windows(tuple(indices or ()), tuple(config.action_delta_indices or ())),
        drop_last=drop_last,
        inner=inner,
        adapters=bool(settings.lora_rank),
    )


def _policy(
    settings: ImitationSettings, dataset: Dataset, config: Any, start: Path | None, continued: Path | None
) -> Any:
    """Make the network, with the weights to start or to continue with. Raises RunError; LibraryMissing."""
    from lerobot.policies.factory import get_policy_class

    weights = continued if continued is not None and not settings.lora_rank else start
    try:
        kind = get_policy_class(settings.policy_type)
        if weights is None:
            return kind(config)
        with _without_download(config):
            return kind.from_pretrained(weights, config=config, strict=True)
    except ModuleNotFoundError as error:
        raise LibraryMissing(
            f"{settings.policy_type} requires {error.name}, which is not installed: install "
            "joshua-lerobot[policies]"
        ) from error
    except (RuntimeError, ValueError, OSError, AssertionError) as error:
        if is_out_of_memory(error):
            raise
        said = " ".join(str(error).split())[:300]
        if weights is None:
            remedy = (
                "set pretrained_backbone: false, or connect to the network, which its weights come from"
                if settings.pretrained_backbone and isinstance(error, OSError)
                else "change the setting that this names"
            )
            raise RunError(
                f"{settings.policy_type} cannot be made with these settings: {said}: {remedy}"
            ) from error
        raise RunError(
            f"the weights of {weights} do not fit the data set {dataset.folder}, or the settings of the "
            f"file: {said}: name a checkpoint that was trained on the same joints and cameras"
        ) from error


@contextmanager
def _without_download(config: Any) -> Iterator[None]:
    """Make the image network without the weights of its configuration, which a checkpoint replaces."""
    name = "pretrained_backbone_weights"
    kept = getattr(config, name, None)
    if kept is not None:
        setattr(config, name, None)
    try:
        yield
    finally:
        if kept is not None:
            setattr(config, name, kept)


def _schedule(settings: ImitationSettings, config: Any, last: int) -> Any:
    """Return how the step size changes: LeRobot's description, None for a constant one."""
    if settings.learning_rate_schedule == "constant":
        return None
    if settings.learning_rate_schedule != "cosine":
        return config.get_scheduler_preset()
    from lerobot.optim.schedulers import CosineDecayWithWarmupSchedulerConfig

    rate = settings.learning_rate
    return CosineDecayWithWarmupSchedulerConfig(
        num_warmup_steps=min(_MOST_WARM_UP, last // 20),
        num_decay_steps=last,
        peak_lr=rate,
        decay_lr=rate / 100,
    )


def _adapted(policy: Any, settings: ImitationSettings, start: Path | None) -> Any:
    try:
        import peft  # noqa: F401
    except ImportError as error:
        raise LibraryMissing(
            f"lora_rank requires {error.name}, which is not installed: install joshua-imitation[lora], or "
            "remove lora_rank"
        ) from error
    policy.config.pretrained_path = start
    return policy.wrap_with_peft(peft_cli_overrides={"method_type": "LORA", "r": settings.lora_rank})


def _learn_by_l1(policy: Any) -> None:
    """Make diffusion use the absolute error: LeRobot's own function with the other loss."""
    from types import FunctionType, SimpleNamespace

    own = type(policy.diffusion).compute_loss
    functional = SimpleNamespace(**vars(torch.nn.functional))
    functional.mse_loss = torch.nn.functional.l1_loss
    names = {**own.__globals__, "F": functional}
    changed = FunctionType(own.__code__, names, own.__name__, own.__defaults__, own.__closure__)
    policy.diffusion.compute_loss = changed.__get__(policy.diffusion)


def save_policy(parts: Parts, dataset: Dataset, folder: Path, final: Path) -> None:
    """Write the policy in LeRobot's format, with the description of its data set beside it.

    Args:
        final: where the folder will be once it is complete.
    """
    policy = parts.policy
    if parts.adapters:  # merged, so that loading requires no adapters
        policy = copy.deepcopy(policy).merge_and_unload()
        policy.config.use_peft = False
    folder.mkdir(parents=True, exist_ok=True)
    for part in (policy, parts.before, parts.after):
        part.save_pretrained(folder)
    info = {
        key: value
        for key, value in dataset.info.items()
        if key in ("features", "fps", "robot_type", "codebase_version", "total_episodes", "total_frames")
    }
    (folder / DATASET).write_text(json.dumps(info, indent=2) + "\n", encoding="utf-8")
    if parts.inner is not None:
        shutil.copytree(parts.inner, folder / LANGUAGE_MODEL, dirs_exist_ok=True)
        _name_language_model(folder, str(final.absolute() / LANGUAGE_MODEL))


def _name_language_model(folder: Path, place: str) -> None:
    """Name the folder of the language model by its absolute path; LeRobot looks for others on the hub."""
    for name in (CONFIG, PREPROCESSOR):
        content = parse_json((folder / name).read_text(encoding="utf-8"))
        if name == CONFIG:
            content["vlm_model_name"] = place
        for step in content.get("steps", ()):
            if "tokenizer_name" in step.get("config", ()):
                step["config"]["tokenizer_name"] = place
        (folder / name).write_text(json.dumps(content, indent=4), encoding="utf-8")
