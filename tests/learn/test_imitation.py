"""Imitation: LeRobot's policies learn from recordings, stop, and go on bit for bit."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import remotes
import tiny_policies
import torch
from hub_server import TOKEN, HubServer
from huggingface_hub.utils import reset_sessions
from joshua_dataset.cloud.copies import store_of
from joshua_dataset.cloud.store import Tally
from joshua_dataset.cloud.upload import upload
from joshua_dataset.reader import Dataset
from joshua_imitation.build import build
from joshua_imitation.data import Recording, Windows
from joshua_imitation.learner import POLICY, STATE, TRAINING, Learner
from joshua_imitation.loader import Maker
from joshua_imitation.pictures import Album
from joshua_lerobot.checkpoint import read_checkpoint
from joshua_training.run_folder import RunError, RunFolder
from learners import DIFFUSION, differ, rows, settings, weights
from learners import learner as learner
from learners import recording as recording
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from safetensors.torch import load_file
from serving import serving
from tiny_recordings import FPS, JOINTS


def smolvla(base: Path) -> dict[str, Any]:
    """Settings that fine-tune a tiny SmolVLA, which is written into a folder."""
    tiny_policies.make_smolvla(base)
    fields = {**DIFFUSION, "hidden_size": None, "chunk_size": None}
    return fields | {"policy_type": "smolvla", "pretrained": str(base)}


@pytest.mark.parametrize("schedule", ["constant", "cosine"])
def test_a_continued_training_takes_the_learning_rate_of_its_file(
    learner: Callable[..., Learner], schedule: str
) -> None:
    fields = {"learning_rate_schedule": schedule, "report_steps": 1}
    first = learner(**fields)
    began = rows(first, 4)
    checkpoint = first.save()
    same = rows(learner(checkpoint, **fields), 5)
    lower = rows(learner(checkpoint, **fields, learning_rate=1e-4), 5)
    again, changed = (found[0]["optimiser/learning_rate"] for found in (same, lower))
    assert changed == pytest.approx(again / 10, rel=1e-6)
    if schedule == "constant":
        assert again == began[-1]["optimiser/learning_rate"] == 1e-3
    else:
        assert again != began[-1]["optimiser/learning_rate"]


@pytest.mark.parametrize("windows", [Windows((), tuple(range(5))), Windows((-1, 0), (-1, 0, 1, 2))])
@pytest.mark.parametrize("room_mb", [100, 0], ids=["decoded", "while reading"])
def test_batches_are_those_of_lerobots_data_sets(recording: Path, windows: Windows, room_mb: int) -> None:
    around = {"action": [step / FPS for step in windows.done]}
    if windows.seen:
        for key in ("observation.state", "observation.images.top", "observation.images.wrist"):
            around[key] = [step / FPS for step in windows.seen]
    theirs = LeRobotDataset("me/set", root=recording, delta_timestamps=around)
    read = Recording(Dataset.read(recording))
    album = Album(read, None, room_mb)
    assert album.decoded == bool(room_mb)
    album.fill(lambda count: True)
    frames = np.array([0, 11, 12, 20, 25, 31])
    batch = Maker(read, album, windows).make(frames)
    for at, frame in enumerate(frames):
        item = theirs[int(frame)]
        assert batch["task"][at] == item["task"]
        for key in ("action", "observation.state", "action_is_pad"):
            assert torch.equal(batch[key][at], item[key]), key
        for key in read.pictures:
            assert batch[key][at].shape == item[key].shape
            assert (batch[key][at] - item[key]).abs().max() <= 1.01 / 255
    album.close()


CHANGES: list[dict[str, Any]] = [
    {"learning_rate": 1e-4},
    {"batch_size": 5},
    {"seed": 2},
    {"chunk_size": 4},
    {"cameras": ("top",)},
    {"image_width": 32, "image_height": 24},
    {"validation_share": 0.5},
    {"colour_jitter": 0.3},
    {"shift_px": 3},
    {"state_noise": 0.1},
    {"accumulation_steps": 2},
    {"precision": "bfloat16"},
    {"hidden_size": 48},
    {"feedforward_size": 48},
    {"encoder_layers": 2},
    {"backbone_learning_rate": 1e-5},
    {"weight_decay": 0.5},
    {"max_grad_norm": 0.001},
    {"learning_rate_schedule": "cosine"},
    {"use_vae": False},
]


def test_every_setting_takes_effect(learner: Callable[..., Learner]) -> None:
    def learned(**fields: Any) -> dict[str, Any]:
        made = learner(**fields)
        rows(made, 2)
        return weights(made)

    base = learned()
    assert not differ(base, learned())
    assert not differ(base, learned(workers=0))
    assert not differ(base, learned(picture_cache_mb=0, workers=3))
    for changed in CHANGES:
        assert differ(base, learned(**changed)), changed
    assert learner(num_epochs=5).total == 20  # 21 frames of two episodes, 6 at a time
    assert learner(max_steps=7, num_epochs=5).total == 7
    assert learner(actions_per_chunk=3).parts.config.n_action_steps == 3


def test_accumulated_batches_learn_as_a_large_one(
    learner: Callable[..., Learner], monkeypatch: pytest.MonkeyPatch
) -> None:
    noise, times = torch.randn(64, 8, len(JOINTS)), torch.randint(0, 100, (64,))

    def gradient(**fields: Any) -> float:
        made = learner(
            policy_type="diffusion",
            **DIFFUSION,
            cameras=("top",),
            report_steps=1,
            validation_share=0.0,
            **fields,
        )
        taken = {"noise": 0, "times": 0}

        def next_of(name: str, values: Any, count: int) -> Any:
            taken[name] += count
            return values[taken[name] - count : taken[name]]

        # the samples of both get the same noise
        monkeypatch.setattr(torch, "randn", lambda shape, **more: next_of("noise", noise, shape[0]))
        monkeypatch.setattr(torch, "randint", lambda size, **more: next_of("times", times, size[0]))
        row = made.update()
        monkeypatch.undo()
        made.close()
        assert row is not None
        return row["optimiser/gradient_norm"]

    parts = gradient(batch_size=4, accumulation_steps=2)
    assert parts == pytest.approx(gradient(batch_size=8), rel=1e-3)


@pytest.mark.parametrize(
    "fields",
    [
        {"colour_jitter": 0.2, "shift_px": 2, "state_noise": 0.1, "accumulation_steps": 2, "num_epochs": 4},
        {"policy_type": "diffusion", **DIFFUSION, "cameras": ("top",), "max_steps": 6},
    ],
    ids=["act", "diffusion"],
)
def test_a_continued_training_is_the_same_bit_for_bit(
    learner: Callable[..., Learner], fields: dict[str, Any]
) -> None:
    whole = learner(**fields)
    expected = rows(whole)
    final = whole.save()
    first = learner(**fields)
    begun = rows(first, 5)  # within a window of metrics, and within an epoch
    kept = first.save()
    second = learner(kept, **fields)
    assert second.steps == 5
    assert begun + rows(second) == expected
    other = second.save()
    for name in (f"{POLICY}/model.safetensors", TRAINING, STATE):
        assert (final / name).read_bytes() == (other / name).read_bytes(), name


def test_validation_is_without_dropout_and_with_the_whole_loss(learner: Callable[..., Learner]) -> None:
    made = learner(validation_share=0.5)
    policy = made.parts.policy
    first = made.validate()
    assert made.validate() == first
    assert all(module.training for module in policy.modules())
    for module in policy.modules():
        if isinstance(module, torch.nn.Dropout):
            module.p = 0.0
        elif isinstance(module, torch.nn.MultiheadAttention):
            module.dropout = 0.0
    assert made.validate() == first
    policy.config.kl_weight *= 2
    assert made.validate() > first


def test_diffusion_learns_by_either_loss(learner: Callable[..., Learner]) -> None:
    found = {}
    for loss in ("", "mse", "l1"):
        made = learner(
            policy_type="diffusion", loss_function=loss, cameras=("top",), report_steps=1, **DIFFUSION
        )
        found[loss] = rows(made, 1)[-1]["loss/train"]
    assert found[""] == found["mse"]
    assert found["l1"] != found["mse"]


@pytest.mark.parametrize("policy_type", ["act", "diffusion", "smolvla"])
def test_checkpoints_are_lerobots(
    learner: Callable[..., Learner], recording: Path, tmp_path: Path, policy_type: str
) -> None:
    from lerobot.policies.factory import get_policy_class, make_pre_post_processors

    fields: dict[str, Any] = {"policy_type": policy_type}
    if policy_type == "diffusion":
        fields |= {**DIFFUSION, "cameras": ("top",)}
    elif policy_type == "smolvla":
        fields |= smolvla(tmp_path / "base")
    made = learner(**fields)
    rows(made, 2)
    folder = made.save() / POLICY
    shutil.rmtree(tmp_path / "base", ignore_errors=True)  # the checkpoint stands by itself
    policy = get_policy_class(policy_type).from_pretrained(folder)
    assert not differ(policy.state_dict(), weights(made))
    before, after = make_pre_post_processors(policy.config, str(folder))
    item = LeRobotDataset("me/set", root=recording)[3]
    seen = {key: value for key, value in item.items() if key.startswith("observation.")}
    action = after(policy.select_action(before({**seen, "task": "wave"})))
    assert action.shape == (1, len(JOINTS))
    assert torch.isfinite(action).all()
    found = read_checkpoint(folder)
    assert (found.type, found.fps) == (policy_type, FPS)
    assert found.described("action") == (JOINTS, "rad")
    kinds = {path.suffix for path in folder.parent.rglob("*") if path.is_file()}
    assert kinds - {".jinja"} == {".json", ".safetensors"}


def test_smolvla_is_fine_tuned_from_a_checkpoint(learner: Callable[..., Learner], tmp_path: Path) -> None:
    fields = smolvla(tmp_path / "base")
    made = learner(**fields)
    start = weights(made)
    rows(made, 3)
    moved = [key for key, value in weights(made).items() if not torch.equal(value, start[key])]
    assert any("lm_expert" in key for key in moved)
    assert not any("vision_model" in key for key in moved)
    run = made.save().parents[1].rename(tmp_path / "elsewhere")
    shutil.rmtree(tmp_path / "base")
    (policy,) = run.glob(f"checkpoints/*/{POLICY}")
    again = learner(**{**fields, "pretrained": str(policy)})
    assert not differ(weights(again), weights(made))


def test_adapters_of_smolvla_are_merged_into_its_checkpoint(
    learner: Callable[..., Learner], tmp_path: Path
) -> None:
    pytest.importorskip("peft")
    fields = smolvla(tmp_path / "base") | {"lora_rank": 4, "validation_share": 0.0, "max_steps": 4}
    whole = learner(**fields)
    few = sum(weight.numel() for weight in whole.parts.policy.parameters() if weight.requires_grad)
    assert few < 0.2 * sum(weight.numel() for weight in whole.parts.policy.parameters())
    expected = rows(whole)
    first = learner(**fields)
    begun = rows(first, 2)
    kept = first.save()
    assert begun + rows(learner(kept, **fields)) == expected
    names = set(load_file(kept / POLICY / "model.safetensors"))
    assert names == set(load_file(tmp_path / "base" / "model.safetensors"))
    assert not any("lora" in name for name in names)
    assert json.loads((kept / POLICY / "config.json").read_text())["use_peft"] is False


def test_a_streamed_data_set_teaches_the_same(
    recording: Path, learner: Callable[..., Learner], monkeypatch: pytest.MonkeyPatch
) -> None:
    local = learner(max_steps=4)
    expected = rows(local)
    server = HubServer()
    with serving(server):
        endpoint = f"http://127.0.0.1:{server.port}"
        form = endpoint + "/{repo_id}/resolve/{revision}/{filename}"
        monkeypatch.setenv("HF_TOKEN", TOKEN)
        for name, value in (
            ("constants.ENDPOINT", endpoint),
            ("file_download.HUGGINGFACE_CO_URL_TEMPLATE", form),
            ("constants.HF_HUB_OFFLINE", False),
        ):
            monkeypatch.setattr(f"huggingface_hub.{name}", value)
        reset_sessions()  # one of an earlier test refuses while offline
        address = "hf://datasets/me/demos"
        upload(recording, store_of(address), Tally())
        for room_mb in (100, 0):
            built = build(
                settings(recording, max_steps=4, picture_cache_mb=room_mb).model_copy(
                    update={"dataset": address}
                )
            )
            stream = built.album._stream
            assert stream is not None
            assert (stream.folder / "meta/info.json").is_file()
            assert not list(stream.folder.rglob("*.mp4"))
            assert built.album.fill(lambda count: False)
            assert not list(stream.videos.iterdir())
            streamed = built.learner(RunFolder(recording))
            assert rows(streamed) == expected
            assert not differ(weights(local), weights(streamed))
            assert list(stream.videos.iterdir())
            built.album.close()
            assert not stream.folder.exists()
    with pytest.raises(RunError, match=r"hf://datasets/me/none cannot be streamed: .*"):
        build(settings(recording).model_copy(update={"dataset": "hf://datasets/me/none"}))


@pytest.mark.parametrize("kind", ["s3", "gs"])
def test_a_data_set_in_a_bucket_is_streamed_for_an_epoch(
    kind: str, recording: Path, learner: Callable[..., Learner], monkeypatch: pytest.MonkeyPatch
) -> None:
    fields: dict[str, Any] = {"num_epochs": 1, "picture_cache_mb": 0}
    expected = rows(learner(**fields))
    with remotes.KINDS[kind]() as remote:
        remotes.use(remote, monkeypatch)
        address = f"{remote.url}/demos"
        upload(recording, store_of(address), Tally())
        built = build(settings(recording, **fields).model_copy(update={"dataset": address}))
        streamed = built.learner(RunFolder(recording))
        assert rows(streamed) == expected
        assert built.album._stream is not None
        assert list(built.album._stream.videos.iterdir())
        built.album.close()
        with pytest.raises(RunError, match=rf"{address}-none cannot be streamed: .*{address}-none"):
            build(settings(recording).model_copy(update={"dataset": f"{address}-none"}))
        again = build(settings(recording, **fields).model_copy(update={"dataset": address}))
        there = store_of(address)
        there.remove([name for name in there.listing() if name.endswith(".mp4")])
        with pytest.raises(RunError, match=r"cannot be streamed: .*: continue with resume_run"):
            rows(again.learner(RunFolder(recording)))
        again.album.close()
