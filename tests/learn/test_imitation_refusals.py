"""Imitation: what it refuses to learn from or to continue, and where it stops, it says with the remedy."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from joshua_imitation.build import build
from joshua_imitation.learner import POLICY, STATE, TRAINING, DivergedError, Learner
from joshua_training.run_folder import RunError, RunFolder
from learners import DIFFUSION, differ, rows, settings, weights
from learners import learner as learner
from learners import recording as recording
from safetensors.torch import load_file
from tiny_recordings import JOINTS, write_recording


def test_a_checkpoint_of_other_features_is_refused_at_the_start(
    learner: Callable[..., Learner], recording: Path, tmp_path: Path
) -> None:
    made = learner()
    rows(made, 1)
    start = made.save() / POLICY

    def refused(data: Path, place: Path, said: str, **fields: Any) -> None:
        """Not seen by the check of the file, such as a checkpoint on the hub."""
        with pytest.raises(RunError, match=said):
            build(settings(data, **fields).model_copy(update={"pretrained": str(place)}))

    renamed = write_recording(tmp_path / "renamed", joints=tuple("abcdef"))
    joints = ", ".join(JOINTS)
    refused(renamed, start, f"observation.state of {start} has the joints {joints}, but that of {renamed} ha")
    refused(recording, start, 'holds a policy of type act. Set policy_type: "act"', policy_type="diffusion",
            **DIFFUSION)  # fmt: skip
    refused(recording, tmp_path, f"pretrained: {tmp_path} has no config.json")
    shutil.copy(renamed / "meta" / "info.json", start / "dataset.json")  # as the message says
    assert build(settings(renamed, pretrained=str(start))).learned == 2
    other = write_recording(tmp_path / "other", joints=JOINTS[:5])
    (start / "dataset.json").unlink()  # a checkpoint whose joints are unknown
    refused(other, start, r"the weights of .* do not fit the data set .*other")


@pytest.mark.parametrize("name", [f"{POLICY}/model.safetensors", f"{POLICY}/dataset.json", TRAINING, STATE])
@pytest.mark.parametrize("how", ["torn", "missing"])
def test_a_torn_checkpoint_says_so(learner: Callable[..., Learner], name: str, how: str) -> None:
    made = learner()
    rows(made, 1)
    kept = made.save()
    content = (kept / name).read_bytes()
    (kept / name).write_bytes(content[: len(content) // 2]) if how == "torn" else (kept / name).unlink()
    with pytest.raises(RunError, match=r"cannot be used: .*: start a new run, because there is no older one"):
        learner(kept)


def _described(folder: Path, **values: Any) -> None:
    path = folder / "meta" / "info.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


@pytest.mark.parametrize(
    ("fields", "values", "said"),
    [
        ({"joints": tuple("abcdef")}, {}, r"whose observation.state is \['shoulder_pan', .*'a', 'b'"),
        ({"joints": JOINTS[:5]}, {}, "whose observation.state is "),
        ({"cameras": ("top", "side")}, {}, "whose observation.images.wrist is a camera, .* it is absent"),
        ({"fps": 20}, {}, "whose fps is 10, but in .* it is 20"),
        ({}, {"robot_type": "koch"}, "whose robot_type is SO-ARM100, but in .* it is koch"),
    ],
)
def test_a_run_is_not_continued_with_the_data_of_another_robot(
    learner: Callable[..., Learner], tmp_path: Path, fields: dict[str, Any], values: dict[str, Any], said: str
) -> None:
    made = learner()
    rows(made, 1)
    other = write_recording(tmp_path / "other", **fields)
    if values:
        _described(other, **values)
    with pytest.raises(RunError, match=f"the run was started with a data set {said}.*: continue with the"):
        build(settings(other), made.save())


@pytest.mark.parametrize("lengths", [(12, 9, 11, 10), (12, 9, 12)])
def test_a_run_is_not_continued_with_other_episodes_but_a_new_one_starts_from_its_weights(
    learner: Callable[..., Learner], tmp_path: Path, lengths: tuple[int, ...]
) -> None:
    made = learner()
    rows(made, 2)
    checkpoint = made.save()
    more = write_recording(tmp_path / "more", lengths=lengths)
    with pytest.raises(RunError) as caught:
        build(settings(more), checkpoint)
    assert str(caught.value) == (
        f"the run was started with 3 episodes of 32 frames in all, but {more} has {len(lengths)} episodes of "
        f"{sum(lengths)} frames in all: other episodes change the order of the batches, the normalisation, "
        "and which episodes are for validation. Remove resume_run, and write pretrained: "
        f'"{checkpoint / POLICY}" to start a new run from its weights'
    )
    built = build(settings(more, pretrained=str(checkpoint / POLICY)))
    begun = built.learner(RunFolder.create(tmp_path, "more", {}))
    assert begun.steps == 0
    assert not differ(weights(begun), weights(made))
    built.album.close()


def test_a_loss_that_is_no_number_stops_and_keeps_its_batch(
    learner: Callable[..., Learner], tmp_path: Path
) -> None:
    made = learner()
    rows(made, 1)
    with torch.no_grad():
        next(iter(made.parts.policy.parameters())).fill_(math.nan)
    made._loader = None
    with pytest.raises(DivergedError, match=r"loss is not a number at update 2; its batch is in .*: lower"):
        made.update()
    made.close()
    (path,) = tmp_path.glob("run-*/failed_batch_2.safetensors")
    assert load_file(path)["action"].shape == (6, 8, len(JOINTS))
    assert made.steps == 1


def test_updates_that_float16_skips_change_nothing_and_end_where_none_succeeds(
    learner: Callable[..., Learner], tmp_path: Path
) -> None:
    made = learner(num_epochs=20, report_steps=2, learning_rate_schedule="cosine", validation_share=0.0)
    made._scaler = torch.amp.GradScaler("cpu")  # as float16 has on a GPU
    factor = [math.nan]
    next(iter(made.parts.policy.parameters())).register_hook(lambda gradient: gradient * factor[0])
    before, rate = weights(made), made.parts.optimiser.param_groups[0]["lr"]
    made.update()
    assert not differ(before, weights(made))
    assert made.parts.optimiser.param_groups[0]["lr"] == rate
    assert made._scaler.get_scale() == 2.0**15
    factor[0] = 1.0
    row = made.update()
    assert row is not None
    assert all(math.isfinite(value) for value in row.values())
    assert differ(before, weights(made))
    assert made.parts.optimiser.param_groups[0]["lr"] != rate
    alone = learner(num_epochs=20, report_steps=1, learning_rate_schedule="cosine", validation_share=0.0)
    alone._order, alone.steps = made._order, 1
    assert row["optimiser/gradient_norm"] == pytest.approx(rows(alone, 2)[0]["optimiser/gradient_norm"])
    factor[0] = math.nan
    with pytest.raises(
        DivergedError,
        match=r"gradient is not a number at update 22; its batch is in .*: set precision: \"bfloat16\", or",
    ):
        rows(made)
    made.close()
    assert list(tmp_path.glob("run-*/failed_batch_22.safetensors"))
    state = (made.save() / STATE).read_text()
    assert "NaN" not in state
    assert "Infinity" not in state


def test_values_of_the_data_set_that_are_no_numbers_are_named(
    learner: Callable[..., Learner], tmp_path: Path
) -> None:
    made = learner(batch_size=20)
    made._recording.numbers["action"][:] = math.nan
    with pytest.raises(DivergedError, match="action of the data set has values that are not numbers: run"):
        made.update()
    made.close()


def test_a_full_disk_leaves_the_checkpoints_before(
    learner: Callable[..., Learner], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = learner()
    rows(made, 1)
    first = made.save()

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    made.steps += 1
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(
        RunError, match="cannot be written: No space left on device: free some space, and continue"
    ):
        made.save()
    monkeypatch.undo()
    assert [path.name for path in first.parent.iterdir()] == [first.name]


#: Builds trainings, and makes an update, with less memory than they need. Where it ends elsewhere than
#: expected, it ends this process alone.
WITHOUT_MEMORY = """
import resource
import sys
from pathlib import Path

import learners
from joshua_imitation.build import build
from joshua_training.run_folder import RunError, RunFolder

data, folder = map(Path, sys.argv[1:])


def refused(part):
    try:
        part()
    except RunError as error:
        print(error)


def network(**fields):
    refused(lambda: build(learners.settings(data, **fields)))


large = dict(image_width=2784, image_height=2088, picture_cache_mb=0, validation_share=0.0)
learner = build(learners.settings(data, **large)).learner(RunFolder(folder))
learner.save()
status = Path("/proc/self/status").read_text()
used = 1024 * next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmSize"))
resource.setrlimit(resource.RLIMIT_AS, (used + (300 << 20), resource.RLIM_INFINITY))
refused(learner.update)
network(hidden_size=32768)
network(**learners.DIFFUSION | dict(policy_type="diffusion", hidden_size=32768))
"""


def test_without_memory_the_setting_that_needs_less_is_named(recording: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_MEMORY, str(recording), str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.splitlines() == [
        "the memory is full: set batch_size: 3 and accumulation_steps: 2, which needs half the memory and "
        "learns nearly the same, and continue with resume_run; the last checkpoint is complete",
        "the memory is full: set hidden_size: 16384 and feedforward_size: 16, which needs about a quarter of "
        "the memory for the network",
        "the memory is full: set hidden_size: 16384, which needs about a quarter of the memory for the "
        "network",
    ], done.stderr


def test_a_data_set_that_cannot_be_used_is_named(recording: Path, tmp_path: Path) -> None:
    with pytest.raises(RunError, match="is not a folder here, and LeRobot cannot load it from the hub"):
        build(settings(Path("acme/nothing")))
    short = write_recording(tmp_path / "short", lengths=(3,))
    with pytest.raises(RunError, match="too short for a chunk of this policy"):
        build(settings(short, policy_type="diffusion", **DIFFUSION))
    with pytest.raises(RunError, match=r'device: "cuda" is not available; PyTorch .* finds cpu'):
        build(settings(recording, device="cuda"))
    copy = tmp_path / "copy"
    shutil.copytree(recording, copy)
    stats = json.loads((copy / "meta" / "stats.json").read_text())
    action = stats.pop("action")
    (copy / "meta" / "stats.json").write_text(json.dumps(stats))
    with pytest.raises(RunError, match=r"stats.json lacks action: .*Run `joshua dataset stats --write "):
        build(settings(copy))
    stats["action"] = action | {"mean": [math.nan] * len(action["mean"])}
    (copy / "meta" / "stats.json").write_text(json.dumps(stats))
    with pytest.raises(
        RunError, match=r"mean of action in .* is not finite: .*Run `joshua dataset stats --write "
    ):
        build(settings(copy))
    (copy / "meta" / "stats.json").write_text("{")
    with pytest.raises(RunError, match=r"stats.json cannot be read: .*Run `joshua dataset stats --write "):
        build(settings(copy))
    next((copy / "meta" / "episodes").glob("*/*.parquet")).unlink()
    with pytest.raises(RunError, match=r"cannot be learned from: .*Run `joshua dataset repair "):
        build(settings(copy))
