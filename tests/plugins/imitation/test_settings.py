"""What a validation says of imitation learning; nothing heavy is imported for it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from checkpoints import write_checkpoint, write_dataset
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
from joshua.plugins.block_context import BlockContext, DataStoreContext
from joshua.schema import config_pb2 as pb
from joshua_imitation.settings import ImitationSettings

JOINTS = {"dtype": "float32", "shape": [6], "names": list("abcdef")}
PICTURE = {"dtype": "video", "shape": [48, 64, 3], "names": ["height", "width", "channels"]}
FEATURES = {"observation.state": JOINTS, "action": JOINTS, "observation.images.top": PICTURE}


def described(folder: Path, **changes: Any) -> Path:
    """A folder with the description of a data set."""
    (folder / "demos" / "meta").mkdir(parents=True, exist_ok=True)
    info = {"codebase_version": "v3.0", "fps": 25, "features": FEATURES, **changes}
    (folder / "demos" / "meta" / "info.json").write_text(json.dumps(info))
    return folder / "demos"


def errors(
    folder: Path,
    fields: str = "",
    environment: str = "ENV_SIMULATION",
    name: str = 'dataset_name: "demos"',
    cluster: str = "",
) -> list[Any]:
    """What a validation finds."""
    described(folder) if not (folder / "demos").exists() else None
    path = folder / "train.pbtxt"
    path.write_text(f"""
general {{ mode: MODE_TRAINING name: "train" id: "train-imitation-test" }}
ai {{
  training {{
    environment: {environment}
    method: METHOD_IMITATION {cluster}
    imitation_config {{
      {name} num_epochs: 2 learning_rate: 0.001 batch_size: 4
      {fields}
    }}
  }}
}}
""")
    return list(examine(Request(str(path), purpose=Purpose.VALIDATE)).errors)


def test_a_training_is_valid_without_anything_heavy(tmp_path: Path) -> None:
    assert errors(tmp_path) == []
    code = f"""
import sys
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
assert not examine(Request({str(tmp_path / "train.pbtxt")!r}, purpose=Purpose.VALIDATE)).errors
print(sorted({{"torch", "lerobot", "numpy", "pyarrow", "av", "safetensors"}} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("policy", "loss", "own", "why"),
    [
        ("act", "mse", "l1", "ACT learns by the absolute error of its chunks"),
        ("smolvla", "l1", "mse", "SmolVLA learns by flow matching"),
    ],
)
def test_a_loss_that_a_policy_does_not_have_is_refused_at_its_line(
    tmp_path: Path, policy: str, loss: str, own: str, why: str
) -> None:
    start = 'pretrained: "lerobot/smolvla_base"' if policy == "smolvla" else ""
    (error,) = errors(tmp_path, f'policy_type: "{policy}" {start} loss_function: "{loss}"')
    assert error.field_path == "ai.training.imitation_config.loss_function"
    assert error.position.line == 9
    assert error.message.startswith(f"The policy {policy} cannot learn by {loss}: {why}")
    assert error.allowed == (f'"{own}"',)
    assert error.remedy == f'Write loss_function: "{own}", or remove it.'


@pytest.mark.parametrize(
    ("fields", "at", "said"),
    [
        ('policy_type: "diffusion" encoder_layers: 2', "encoder_layers", "it belongs to act"),
        ('policy_type: "diffusion" use_vae: false', "use_vae", "it belongs to act"),
        ("hidden_size: 100", "hidden_size", "so a width of 100 does not fit"),
        ("lora_rank: 8", "lora_rank", "no effect with the policy act: it belongs to smolvla"),
        ('policy_type: "smolvla"', "policy_type", "it requires a checkpoint to start from"),
        ('pretrained: "a/b" pretrained_backbone: true', "pretrained_backbone", "no effect with pretrained"),
        ('policy_type: "diffusion" chunk_size: 12', "chunk_size", "so 12 does not fit"),
        ("chunk_size: 8 actions_per_chunk: 9", "actions_per_chunk", "A chunk has 8 actions, so 9"),
        (
            'policy_type: "diffusion" chunk_size: 8 actions_per_chunk: 8',
            "actions_per_chunk",
            "begins at the first of its 2 observations, so at most 7 of 8 actions are still to be executed",
        ),
        ('policy_type: "diffusion" actions_per_chunk: 16', "actions_per_chunk", "at most 15 of 16 actions"),
        ("image_width: 64", "image_width", "image_width is set without image_height"),
        ('device: "cpu" precision: "float16"', "precision", "float16 requires cuda"),
        ('cameras: ["tpo"]', "cameras", "has no pictures of a camera 'tpo'"),
        ('processes: 2 device: "mps"', "processes", "mps is one device, so 2 processes cannot have one each"),
        ("machines: 2", "machines", "2 machines have no address where they meet"),
        ('main_address: "10.0.0.1"', "main_address", '"10.0.0.1" is not a host and a port'),
        ("machine_rank: 1", "machine_rank", "so 1 of them have no number 1"),
        ("robot_episodes: 3", "robot_episodes", "it belongs to evaluations on the robot"),
    ],
)
def test_what_does_not_fit_together_is_named(tmp_path: Path, fields: str, at: str, said: str) -> None:
    (error,) = errors(tmp_path, fields)
    assert error.field_path == f"ai.training.imitation_config.{at}"
    assert said in error.message
    assert error.remedy


@pytest.mark.parametrize("size", [(32, 24), (96, 72), (85, 64), (86, 64)])
def test_pictures_keep_their_proportions(tmp_path: Path, size: tuple[int, int]) -> None:
    width, height = size
    assert errors(tmp_path, f"image_width: {width} image_height: {height}") == []


def test_a_size_that_distorts_pictures_is_refused_with_the_nearest_that_fit(tmp_path: Path) -> None:
    (error,) = errors(tmp_path, "image_width: 128 image_height: 128")
    assert error.field_path == "ai.training.imitation_config.image_width"
    assert error.message == (
        "Pictures of top are 64 × 48, and 128 × 128 would distort them: the robot's camera and a simulation "
        "make no such pictures."
    )
    assert error.allowed == ("128 × 96", "171 × 128")
    assert error.remedy == (
        "Write image_width: 128 image_height: 96 or image_width: 171 image_height: 128, or remove both."
    )
    wide = {"dtype": "video", "shape": [3, 36, 64], "names": ["channels", "height", "width"]}
    described(tmp_path, features=FEATURES | {"observation.images.side": wide})
    (error,) = errors(tmp_path, "image_width: 32 image_height: 24")
    assert error.message.startswith("Pictures of side are 64 × 36, and 32 × 24 would distort them")
    assert error.remedy.startswith("Remove image_width and image_height, or name cameras of the same propor")
    assert errors(tmp_path, 'cameras: ["top"] image_width: 32 image_height: 24') == []


@pytest.mark.parametrize(
    ("shape", "size", "allowed"),
    [((1080, 1920), (2048, 2048), ("2048 × 1152",)), ((10, 2000), (64, 64), ())],
)
def test_only_sizes_that_are_allowed_are_recommended(
    tmp_path: Path, shape: tuple[int, int], size: tuple[int, int], allowed: tuple[str, ...]
) -> None:
    top = {"dtype": "video", "shape": [3, *shape], "names": ["channels", "height", "width"]}
    described(tmp_path, features=FEATURES | {"observation.images.top": top})
    (error,) = errors(tmp_path, f"image_width: {size[0]} image_height: {size[1]}")
    assert error.allowed == allowed
    assert "image_width" in error.remedy


def test_a_training_on_the_robot_requires_a_model_and_an_arm(tmp_path: Path) -> None:
    found = errors(tmp_path, environment="ENV_REAL")
    assert [item.code for item in found] == ["mode-lacks-model", "mode-lacks-actuator"]


def test_one_process_learns_beside_a_robot(tmp_path: Path) -> None:
    found = errors(tmp_path, "processes: 2", environment="ENV_REAL")
    (error,) = (item for item in found if item.field_path.endswith("processes"))
    assert "learning pauses while the robot is evaluated" in error.message


def test_the_workers_of_a_cluster_are_the_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("joshua_ray.executor.check", lambda address: None)
    two = 'cluster { address: "local" workers: 2 }'
    assert errors(tmp_path, cluster=two) == []
    (error,) = errors(tmp_path, cluster='cluster { address: "local" }')
    assert error.field_path == "ai.training.cluster"
    assert "the result depends on the number of workers" in error.message
    assert error.remedy == "Add workers to cluster, for example workers: 2."
    for field in ("processes: 2", "machines: 2", 'main_address: "10.0.0.1:1000"'):
        (error,) = errors(tmp_path, field, cluster=two)
        assert error.field_path == f"ai.training.imitation_config.{field.partition(':')[0]}"
        assert error.position.line == 9
        assert "has no effect with a cluster: its workers are the processes" in error.message
        assert error.remedy.endswith("and write the number of processes as workers in cluster.")
    (error,) = errors(tmp_path, 'device: "mps"', cluster=two)
    assert error.field_path == "ai.training.imitation_config.device"
    assert error.message.startswith("The workers of a cluster learn on cpu or cuda")
    found = errors(tmp_path, environment="ENV_REAL", cluster=two)
    (error,) = (item for item in found if item.field_path == "ai.training.cluster")
    assert error.message.startswith("With ENV_REAL, this run drives a robot, and whoever reaches a cluster")
    assert error.remedy == "Remove it, or write environment: ENV_SIMULATION in training."


def test_an_address_is_streamed_and_checked(tmp_path: Path) -> None:
    assert errors(tmp_path, 'dataset_name: "hf://datasets/acme/demos"', name="") == []
    (error,) = errors(tmp_path, 'dataset_name: "hf://acme/demos"', name="")
    assert error.field_path == "ai.training.imitation_config.dataset_name"
    assert "does not name a data set on the Hub" in error.message
    assert error.allowed == ("hf://datasets/NAME/DATA",)


@pytest.mark.parametrize("names", [("pan", *"bcdef"), tuple("bacdef"), tuple("abcde")])
def test_a_checkpoint_of_other_joints_is_refused(tmp_path: Path, names: tuple[str, ...]) -> None:
    start = write_checkpoint(tmp_path / "start", joints=len(names))
    assert errors(tmp_path, 'pretrained: "start"') == []  # its joints are unknown
    write_dataset(start, names=names)
    (error,) = errors(tmp_path, 'pretrained: "start"')
    assert error.field_path == "ai.training.imitation_config.pretrained"
    assert error.message == (
        f"The observation.state of {start} has the joints {', '.join(names)}, but that of "
        f"{tmp_path / 'demos'} has a, b, c, d, e, f; a policy tells its joints apart by their position."
    )
    assert error.remedy == (
        "Name a checkpoint of the same joints in the same order, or remove pretrained. If only their names "
        f"differ, copy meta/info.json of the data set to {start / 'dataset.json'}."
    )
    (start / "dataset.json").write_text((tmp_path / "demos" / "meta" / "info.json").read_text())
    assert errors(tmp_path, 'pretrained: "start"') == []


def test_a_checkpoint_that_cannot_be_used_is_refused(tmp_path: Path) -> None:
    write_checkpoint(tmp_path / "start", kind="smolvla")
    (error,) = errors(tmp_path, 'pretrained: "start"')
    assert error.message == f"{tmp_path / 'start'} holds a policy of type smolvla."
    assert error.remedy.startswith('Set policy_type: "smolvla"')
    write_checkpoint(tmp_path / "long", kind="diffusion", horizon=24, n_obs_steps=3)
    fields = 'pretrained: "long" policy_type: "diffusion" actions_per_chunk: '
    assert errors(tmp_path, fields + "22") == []
    (error,) = errors(tmp_path, fields + "23")
    assert error.field_path == "ai.training.imitation_config.actions_per_chunk"
    assert (error.allowed, error.remedy) == (
        ("1 to 22",),
        "Write actions_per_chunk: 22, or raise chunk_size.",
    )
    (tmp_path / "start" / "model.safetensors").write_bytes(b"torn")
    (error,) = errors(tmp_path, 'pretrained: "start" policy_type: "smolvla"')
    assert "model.safetensors" in error.message


@pytest.mark.parametrize(
    ("fields", "device", "said"),
    [
        (
            {"batch_size": 8},
            "cpu",
            "set batch_size: 4 and accumulation_steps: 2, which needs half the memory",
        ),
        ({"batch_size": 5, "accumulation_steps": 2}, "cuda", "set batch_size: 2 and accumulation_steps: 6, "),
        ({"batch_size": 1}, "cuda", 'set precision: "bfloat16", which needs about half the memory'),
        ({"batch_size": 1}, "cpu", "halve image_width and image_height, which needs a quarter for pictures"),
    ],
)
def test_the_setting_that_halves_the_memory(fields: dict[str, Any], device: str, said: str) -> None:
    assert ImitationSettings(**fields).halves(device).startswith(said)


def test_several_problems_are_told_at_once(tmp_path: Path) -> None:
    found = errors(tmp_path, 'loss_function: "mse" lora_rank: 8')
    assert len(found) == 2


def test_a_data_set_of_something_else_is_refused(tmp_path: Path) -> None:
    described(tmp_path, features={"observation.state": JOINTS})
    (error,) = errors(tmp_path)
    assert error.field_path == "ai.training.imitation_config.dataset_name"
    assert "has no action and no observation.images.NAME (a camera)" in error.message
    assert "it has observation.state" in error.message


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"codebase_version": "v2.1"}, "has the layout v2.1 of LeRobot"),
        ({"joshua": {"format": "csv"}}, "has the layout csv"),
    ],
)
def test_another_layout_is_converted_first(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    described(tmp_path, **changes)
    (error,) = errors(tmp_path)
    assert said in error.message
    assert "joshua dataset convert" in error.remedy


def test_a_torn_description_is_named(tmp_path: Path) -> None:
    described(tmp_path)
    (tmp_path / "demos" / "meta" / "info.json").write_text('{"features": ')
    (error,) = errors(tmp_path)
    assert "info.json does not describe a data set: JSONDecodeError" in error.message
    assert "joshua dataset check" in error.remedy


def test_folders_are_relative_to_the_file_and_the_store_says_where_the_data_is(tmp_path: Path) -> None:
    (tmp_path / "runs" / "a").mkdir(parents=True)
    (tmp_path / "runs" / "a" / "run.json").write_text("{}")
    block = pb.Training(
        environment=pb.ENV_SIMULATION,
        imitation_config=pb.ImitationConfig(dataset_name="demos", resume_run="runs/a"),
    )
    context = BlockContext(folder=str(tmp_path))
    made = ImitationSettings.from_block(block, context=context)
    assert (made.output_folder, made.resume_run) == (str(tmp_path / "runs"), str(tmp_path / "runs/a"))
    assert made.dataset == "demos"
    described(tmp_path)
    assert ImitationSettings.from_block(block, context=context).dataset == str(tmp_path / "demos")
    stored = BlockContext(folder=str(tmp_path), data_store=DataStoreContext(path="/data/demos"))
    assert ImitationSettings.from_block(block, context=stored).dataset == "/data/demos"
    assert made.loss == "l1"
    assert (made.validation_share, made.workers, made.batch_size) == (0.1, 2, 8)
