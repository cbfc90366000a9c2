"""How long an update of ACT takes: by LeRobot's own training script, and as a training here.

Both learn the same network from the same recording, on one thread, and take turns, so that other load spoils
both alike. The same network has frozen batch normalisation, as LeRobot's has without pretrained weights. The
default of a training here, batch normalisation that learns, is printed beside it. The time of a step is that
between two updates: loading, processing and learning.

A further training reads videos of 640 x 480 and keeps no picture decoded: it shows the share of the loader.

Exit code 1 if a step here takes longer than the target.
"""

from __future__ import annotations

import itertools
import logging
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any
from unittest import mock

import torch
from joshua_imitation.build import build
from joshua_imitation.settings import ImitationSettings
from joshua_training.run_folder import RunFolder
from tiny_recordings import write_recording

#: Longest step with the same network, as a multiple of that of LeRobot's training script.
TARGET = 1.05

BATCH, CHUNK, WIDTH, HEIGHT = 8, 20, 128, 96
SHAPE = {"dim_model": 128, "dim_feedforward": 512, "n_encoder_layers": 2}


def main(rounds: int = 3, steps: int = 12) -> int:
    """Measure all in turn. Returns the exit code."""
    torch.set_num_threads(1)
    taken: dict[str, list[float]] = {"lerobot-train": [], "here": [], "here, batch norm learns": []}
    shares = []
    with tempfile.TemporaryDirectory() as scratch:
        recording = write_recording(Path(scratch) / "set", lengths=(60, 60, 60), width=WIDTH, height=HEIGHT)
        for number in range(rounds):
            taken["lerobot-train"] += theirs(recording, Path(scratch) / f"theirs{number}", steps)
            with mock.patch("joshua_imitation.policies.learn_batch_norm"):
                ours, share = here(recording, Path(scratch), steps)
            taken["here"] += ours
            shares.append(share)
            taken["here, batch norm learns"] += here(recording, Path(scratch), steps)[0]
        large = write_recording(Path(scratch) / "large", lengths=(30, 30), width=640, height=480)
        decoding = here(
            large, Path(scratch), steps, picture_cache_mb=0, image_width=WIDTH, image_height=HEIGHT
        )
    base = statistics.median(taken["lerobot-train"])
    for name, values in taken.items():
        p50 = statistics.median(values)
        print(
            f"{name:24} step p50 {1e3 * p50:7.1f} ms   least {1e3 * min(values):7.1f} ms   "
            f"{p50 / base:.2f} of LeRobot's"
        )
    print(f"share of the loader: {statistics.median(shares):.2%} with decoded pictures")
    print(
        f"share of the loader: {decoding[1]:.2%} with videos of 640 x 480 and picture_cache_mb: 0, scaled to "
        f"{WIDTH} x {HEIGHT}; step p50 {1e3 * statistics.median(decoding[0]):.1f} ms"
    )
    ratio = statistics.median(taken["here"]) / base
    verdict = "met" if ratio <= TARGET else "missed"
    print(f"{verdict}: a step with the same network takes {ratio:.2f} of LeRobot's, target <= {TARGET}")
    return int(ratio > TARGET)


def theirs(recording: Path, output: Path, steps: int) -> list[float]:
    """Seconds between the updates of LeRobot's script."""
    from lerobot.configs.default import DatasetConfig
    from lerobot.configs.train import TrainPipelineConfig
    from lerobot.policies.act.configuration_act import ACTConfig
    from lerobot.scripts import lerobot_train

    logging.disable(logging.WARNING)
    policy = ACTConfig(
        chunk_size=CHUNK,
        n_action_steps=CHUNK,
        pretrained_backbone_weights=None,
        device="cpu",
        push_to_hub=False,
        **SHAPE,
    )
    config = TrainPipelineConfig(
        dataset=DatasetConfig(repo_id="me/set", root=str(recording), use_imagenet_stats=False),
        policy=policy,
        output_dir=output,
        batch_size=BATCH,
        steps=steps + 2,
        save_checkpoint=False,
        eval_freq=0,
        log_freq=0,
        num_workers=2,
        seed=0,
    )
    ends: list[float] = []
    own = lerobot_train.update_policy

    def timed(*arguments: Any, **more: Any) -> Any:
        found = own(*arguments, **more)
        ends.append(time.perf_counter())
        return found

    lerobot_train.update_policy = timed
    try:
        lerobot_train.train(config)
    finally:
        lerobot_train.update_policy = own
    return between(ends)


def here(recording: Path, folder: Path, steps: int, **fields: Any) -> tuple[list[float], float]:
    """Seconds of our updates, and the share of them that the loader took; ``fields`` of the settings."""
    settings = ImitationSettings(
        dataset=str(recording),
        num_epochs=1000,
        max_steps=steps + 2,
        batch_size=BATCH,
        learning_rate=1e-5,
        chunk_size=CHUNK,
        hidden_size=SHAPE["dim_model"],
        feedforward_size=SHAPE["dim_feedforward"],
        encoder_layers=SHAPE["n_encoder_layers"],
        validation_share=0.0,
        report_steps=steps + 2,
        device="cpu",
        workers=2,
        **fields,
    )
    made = build(settings)
    made.album.fill(lambda count: True)
    learner = made.learner(RunFolder.create(folder, "here", {}))
    ends = []
    row = None
    while learner.steps < learner.total:
        row = learner.update()
        ends.append(time.perf_counter())
    learner.close()
    made.album.close()
    assert row is not None
    return between(ends), row["rate/loader_share"]


def between(ends: list[float]) -> list[float]:
    """Seconds from each update to the next, without the first, which warms up."""
    return [after - before for before, after in itertools.pairwise(ends[1:])]


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
