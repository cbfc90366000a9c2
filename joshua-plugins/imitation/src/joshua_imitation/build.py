"""Build a training from its settings: data set, policy, order of the batches."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from joshua_lerobot.checkpoint import DATASET, CheckpointError, read_checkpoint
from joshua_training.memory import remedied
from joshua_training.run_folder import RunError, RunFolder, unusable

from joshua_imitation.augmentation import Augmentation
from joshua_imitation.data import PICTURES, Recording, open_dataset, refuse_other_data
from joshua_imitation.group import Group
from joshua_imitation.learner import POLICY, Learner, read_state
from joshua_imitation.loader import Maker, Order
from joshua_imitation.pictures import Album
from joshua_imitation.policies import MORE_MEMORY, make_parts
from joshua_imitation.proportions import distortion
from joshua_imitation.settings import ImitationSettings


@dataclass(frozen=True)
class Built:
    """A training that is ready to start when its run has a folder.

    Attributes:
        learner: makes the learner, given the folder; album: pictures, to be filled first.
        group: this process among those that learn together.
        features: shapes of the policy's inputs and outputs by key.
        weights: trainable ones; frames, learned: frames and episodes to learn from; kept_back: episodes.
    """

    learner: Callable[[RunFolder], Learner]
    album: Album
    group: Group
    features: dict[str, list[int]]
    weights: int
    frames: int
    learned: int
    kept_back: int


@remedied(MORE_MEMORY)
def build(
    settings: ImitationSettings,
    continued: Path | None = None,
    group: Group | None = None,
    shared: Path | None = None,
) -> Built:
    """Build everything but the learner itself.

    Args:
        continued: checkpoint of the run to continue.
        group: this process, if others started it; shared: folder of another process, see ``Album.shared``.

    Raises:
        RunError: data set, settings or checkpoint do not fit; LibraryMissing.
    """
    judges = group is None or group.rank == 0
    if group is None:
        group = Group.of(settings, found_device(settings))
        group.take_gpu()
    device = group.device
    if continued is not None:
        read_state(continued)
        try:
            read_checkpoint(continued / POLICY)
        except CheckpointError as error:
            raise unusable(continued, error.message) from error
    torch.manual_seed(settings.seed)
    with contextlib.ExitStack() as undo:
        dataset, stream = open_dataset(settings.dataset, shared, checks=judges)
        if stream is not None:
            undo.callback(stream.close)
        if continued is not None:
            refuse_other_data(continued / POLICY / DATASET, dataset)
        recording = Recording(dataset, settings.cameras, stream)
        size = (
            (settings.image_height, settings.image_width)
            if settings.image_height is not None and settings.image_width is not None
            else None
        )
        shapes = {key: dataset.features[key].shape for key in recording.pictures}
        recorded = {
            key.removeprefix(PICTURES): (height, width) for key, (height, width, *_) in shapes.items()
        }
        if size is not None and (problem := distortion(recorded, size)) is not None:
            raise RunError(f"{problem}: {problem.remedy}")
        learned, kept_back = recording.split(settings.validation_share, settings.seed)
        album = Album(recording, size, settings.picture_cache_mb, shared)
        undo.callback(album.close)
        place = continued / POLICY if continued is not None else None

        def total(drop_last: int) -> tuple[Order, int]:
            order = Order(
                recording.frames(learned, drop_last),
                settings.batch_size,
                settings.accumulation_steps,
                settings.seed,
                group.rank,
                group.size,
            )
            whole = settings.num_epochs * order.updates_per_epoch
            return order, min(whole, settings.max_steps or whole)

        parts = make_parts(settings, dataset, album.sizes, device, lambda drop: total(drop)[1], place)
        order, last = total(parts.drop_last)
        if not order.updates_per_epoch:
            raise RunError(
                f"the episodes of {dataset.folder} are too short for a chunk of this policy: set a smaller "
                "chunk_size"
            )
        undo.pop_all()
    augmentation = (
        Augmentation(settings.colour_jitter, settings.shift_px, settings.seed, settings.state_noise)
        if settings.colour_jitter or settings.shift_px or settings.state_noise
        else None
    )
    maker = Maker(recording, album, parts.windows, augmentation)
    judge = Maker(recording, album, parts.windows)
    judged = recording.frames(kept_back if judges else [], parts.drop_last)
    described = {**parts.config.input_features, **parts.config.output_features}
    return Built(
        learner=lambda folder: Learner(
            settings, parts, recording, maker, judge, order, judged, last, folder, group
        ),
        album=album,
        group=group,
        features={key: list(feature.shape) for key, feature in described.items()},
        weights=sum(weight.numel() for weight in parts.policy.parameters() if weight.requires_grad),
        frames=len(recording.frames(learned, parts.drop_last)),
        learned=len(learned),
        kept_back=len(kept_back),
    )


def found_device(settings: ImitationSettings) -> str:
    """Return the device of this machine that the file names. Raises RunError if it does not exist."""
    there: dict[str, Any] = {
        "cuda": torch.cuda.is_available,
        "mps": torch.backends.mps.is_available,
        "cpu": lambda: True,
    }
    known = [name for name, is_there in there.items() if is_there()]
    if settings.device == "auto":
        chosen = known[0]
    elif settings.device not in known:
        raise RunError(
            f'device: "{settings.device}" is not available; PyTorch {torch.__version__} finds '
            f'{", ".join(known)}: set device: "auto", or install a PyTorch that is built for it'
        )
    else:
        chosen = settings.device
    refuse_half(settings, chosen)
    if chosen == "cuda" and settings.processes > torch.cuda.device_count():
        raise RunError(
            f"{settings.processes} processes require as many GPUs, but PyTorch finds "
            f"{torch.cuda.device_count()}: set processes: {torch.cuda.device_count()}, or "
            "CUDA_VISIBLE_DEVICES"
        )
    return chosen


def is_emulated(settings: ImitationSettings, device: str, capability: str | None = None) -> bool:
    """Whether a processor has no instructions for the precision: it takes ten times as long, or longer.

    Args:
        capability: instructions that PyTorch uses, such as ``AVX2``; None to ask it.
    """
    instructions = capability or torch.backends.cpu.get_cpu_capability()
    return settings.precision == "bfloat16" and device == "cpu" and instructions == "AVX2"


def refuse_half(settings: ImitationSettings, device: str) -> None:
    """Raise RunError if a device cannot compute in half precision."""
    if settings.precision == "float16" and device != "cuda":
        raise RunError(f'float16 requires cuda, but the device is {device}: set precision: "bfloat16"')
