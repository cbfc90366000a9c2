"""OFFSCREEN writes a data set by itself: the same bytes for the same seed, and PASSIVE replays it."""

from __future__ import annotations

import hashlib
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
from joshua.plugins.settings import FieldError
from joshua.testing.domain import reserved_domain
from joshua_mujoco_sim.episodes import EpisodeMaker, RecordedDrive
from joshua_mujoco_sim.model_file import load_model
from joshua_mujoco_sim.opengl import RenderingError, choose_gl
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.settings_parts import DatasetSettings, check_picture_keys
from joshua_mujoco_sim.trajectories.reading import read_trajectories
from joshua_mujoco_sim.variation import Variation
from joshua_mujoco_sim.world import World, WorldSettings

STORE = (
    'ai { data_store { format: FORMAT_HUGGINGFACE storage: STORAGE_LOCAL dataset_name: "waves" '
    'local_path: "set" task: "Wave." } }'
)


class Silent:
    def info(self, *args: object) -> None:
        pass

    warning = info


def cameras() -> tuple[str, ...]:
    """The camera that is recorded; none where no picture can be drawn."""
    try:
        choose_gl()
    except RenderingError:
        return ()
    return ("top",)


def wave(folder: Path) -> Path:
    path = folder / "wave.csv"
    rows = [f"{k / 20:.2f},{0.3 * math.sin(k / 3):.4f},{0.5 + k / 100:.4f}" for k in range(13)]
    path.write_text("time_s,shoulder_pan,gripper\n" + "\n".join(rows) + "\n")
    return path


def dataset_file(*, generate: str = "count: 1 fps: 20 duration_s: 1", simulation: str = "") -> str:
    return f"""
general {{ mode: MODE_SIMULATION name: "sim" id: "sim-test" robot_type: "SO-ARM100" }}
simulation {{
  mode: OFFSCREEN
  model_path: "so_arm100/scene.xml"
  real_time_factor: 0
  generate {{ {generate} }}
  {simulation}
}}
{STORE}
"""


def run(folder: Path, text: str, name: str = "robot.pbtxt") -> subprocess.CompletedProcess[str]:
    (folder / name).write_text(text)
    with reserved_domain() as domain:
        return subprocess.run(
            [sys.executable, "-m", "joshua.cli.main", "--config", str(folder / name)],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
            capture_output=True,
            text=True,
            timeout=200,
        )


def digests(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_run_makes_a_data_set_that_passive_replays(tmp_path: Path) -> None:
    wave(tmp_path)
    picture = 'cameras: ["top"] width: 64 height: 48' if cameras() else ""
    text = dataset_file(
        generate=f"count: 2 fps: 20 {picture}", simulation='trajectory_path: "wave.csv" seed: 3'
    )
    ended = run(tmp_path, text)
    assert ended.returncode == 0, ended.stderr
    assert f"2 of 2 episodes in {tmp_path}/set" in ended.stderr
    info = json.loads((tmp_path / "set/meta/info.json").read_text())
    assert (info["total_episodes"], info["total_frames"], info["fps"]) == (2, 24, 20)
    assert info["robot_type"] == "SO-ARM100"
    columns = pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet").to_pydict()
    assert columns["stamp_ns"] == [50_000_000 * k for k in range(12)]
    wanted = [0.3 * math.sin(k / 3) for k in range(12)]
    assert [row[0] for row in columns["action"]] == pytest.approx(wanted, abs=2e-3)
    assert [row[0] for row in columns["observation.state"]] != [row[0] for row in columns["action"]]
    if cameras():
        assert (tmp_path / "set/videos/observation.images.top/chunk-000/file-001.mp4").stat().st_size > 500

    found = examine(Request(str(tmp_path / "robot.pbtxt"), purpose=Purpose.LAUNCH))
    (exists,) = found.errors
    assert (exists.code, exists.field_path) == ("dataset-exists", "ai.data_store.local_path")
    assert "is not empty, and a data set is never overwritten" in exists.message

    passive = """
general { mode: MODE_SIMULATION name: "sim" id: "sim-test" }
simulation { mode: PASSIVE model_path: "so_arm100/scene.xml" trajectory_path: "set" replay_speed: 0 }
"""
    replayed = run(tmp_path, passive, "passive.pbtxt")
    assert replayed.returncode == 0, replayed.stderr
    assert "replayed 24 samples of 2 recording(s): within the limits, without a collision" in replayed.stderr


def settings(folder: Path, **changes: object) -> DatasetSettings:
    values = {
        "count": 1,
        "duration_s": 0.2,
        "fps": 20,
        "cameras": (),
        "width": 64,
        "height": 48,
        "folder": str(folder / "set"),
        "task": "Wave.",
        "robot_type": "arm",
        "writer": "joshua_dataset.writer:LeRobotWriter",
    }
    return DatasetSettings.model_validate(values | changes)


def scene(model: str = "so_arm100/scene.xml", variation: Variation | None = None) -> World:
    return World(WorldSettings(model, real_time_factor=0, variation=variation))


def make(folder: Path, seed: int, *, late: int = 0) -> None:
    """Two episodes; ``late`` steps before the first one stand for a run that takes its time to start."""
    folder.mkdir()
    world = scene(
        variation=Variation(
            seed=seed, joint_rad=0.05, object_m=0.02, light=0.3, camera_m=0.005, camera_rad=0.02
        )
    )
    with world.lock:
        world.advance(late)
        wanted = settings(folder, count=2, cameras=cameras())
        maker = EpisodeMaker(world, wanted, read_trajectories(wave(folder)), Silent())
        maker.open()
        maker.begin()
        while not maker.done and not maker.error:
            world.advance(7)
        assert not maker.error
        maker.close()


def test_seed_decides_every_byte(tmp_path: Path) -> None:
    make(tmp_path / "a", 5)
    make(tmp_path / "b", 5, late=33)
    make(tmp_path / "c", 6)
    first, second, other = (digests(tmp_path / name / "set") for name in "abc")
    assert first == second
    assert first.keys() == other.keys()
    differing = {name for name in first if first[name] != other[name]}
    assert {name for name in first if name.startswith(("data/", "videos/"))} <= differing
    tables = [pq.read_table(tmp_path / f"a/set/data/chunk-000/file-00{k}.parquet") for k in range(2)]
    starts = [table["observation.state"][0].as_py() for table in tables]
    assert not np.allclose(*starts)  # each episode has a start of its own


def test_divergence_drops_the_episode(tmp_path: Path) -> None:
    world = scene()
    with world.lock:
        maker = EpisodeMaker(world, settings(tmp_path), (), Silent())
        maker.open()
        maker.begin()
        world.advance(30)
        world.physics.data.qvel[:] = np.nan
        world.advance(30)
        assert world.divergences
        while not maker.done:
            world.advance(10)
        maker.close()
    columns = pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet").to_pydict()
    assert columns["stamp_ns"] == [0, 50_000_000, 100_000_000, 150_000_000]
    assert len(list((tmp_path / "set/data/chunk-000").iterdir())) == 1


def test_divergence_in_the_last_frame_is_not_kept(tmp_path: Path) -> None:
    world = scene()
    with world.lock:
        maker = EpisodeMaker(world, settings(tmp_path), (), Silent())
        maker.open()
        maker.begin()
        world.advance(75)  # the fourth and last frame is due before the next step
        world.physics.data.qvel[:] = np.nan
        world.advance(1)
        assert not maker.done
        while not maker.done:
            world.advance(10)
        maker.close()
    columns = pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet").to_pydict()
    assert columns["stamp_ns"] == [0, 50_000_000, 100_000_000, 150_000_000]
    assert np.isfinite(columns["observation.state"]).all()


def test_cameras_whose_names_become_one_are_refused() -> None:
    with pytest.raises(
        FieldError, match=r"a/b and a_b would both be stored as observation\.images\.a_b"
    ) as caught:
        check_picture_keys(["top", "a/b", "a_b"])
    assert caught.value.field == "generate.cameras[2]"
    assert caught.value.remedy == "rename one of them in the model"


def test_endless_resets_are_an_error(tmp_path: Path) -> None:
    world = scene()
    with world.lock:
        maker = EpisodeMaker(world, settings(tmp_path), (), Silent())
        maker.open()
        maker.begin()
        for _ in range(8):
            world.advance(5)
            world.physics.reset()
        assert "6 episodes in a row were cut off by a reset or a divergence" in maker.error
        maker.close()


def test_a_wheel_follows_a_recording(tmp_path: Path) -> None:
    physics = Physics(load_model("lekoch/scene.xml"))
    group = physics.group(())
    wheel = group.kinds.index("velocity")
    path = tmp_path / "roll.csv"
    path.write_text(f"time_s,{group.joints[wheel]}\n0,0\n1,1\n")
    drive = RecordedDrive(physics, read_trajectories(path)[0])
    while physics.time_s < 2.0:
        drive.command(physics.time_s)
        physics.step()
    assert group.position_rad[wheel] == pytest.approx(1.0, abs=0.05)
    assert group.command[wheel] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("change", "field", "text"),
    [
        (
            {"generate": 'count: 1 fps: 20 duration_s: 1 cameras: ["tap"]'},
            "generate.cameras[0]",
            "no camera named 'tap'",
        ),
        (
            {"generate": 'count: 1 fps: 20 duration_s: 1 cameras: ["top", "front", "top"]'},
            "generate.cameras[2]",
            "top is listed twice",
        ),
        (
            {"generate": "count: 1 fps: 1000 duration_s: 1"},
            "generate.fps",
            "the model makes 500 steps per second",
        ),
        ({"generate": "count: 1 fps: 20"}, "generate", "the length of an episode is not defined"),
        (
            {"generate": 'count: 1 fps: 20 duration_s: 1 cameras: ["top"] width: 33'},
            "generate.width",
            "a video needs an even width and height, and width is 33",
        ),
        ({"simulation": "variation { light: 0.1 }"}, "variation", "has no effect without a seed"),
    ],
)
def test_bad_blocks_are_found_before_the_start(
    tmp_path: Path, change: dict[str, str], field: str, text: str
) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(dataset_file(**change))
    (error,) = examine(Request(str(path), purpose=Purpose.VALIDATE)).errors
    assert error.field_path == f"simulation.{field}"
    assert text in error.message[0].lower() + error.message[1:]


def test_store_and_its_writer_are_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(dataset_file().replace(STORE, ""))
    (lacking,) = examine(Request(str(path), purpose=Purpose.VALIDATE)).errors
    assert (lacking.code, lacking.field_path) == ("mode-lacks-block", "ai.data_store")
    path.write_text(dataset_file())
    request = Request(str(path), purpose=Purpose.LAUNCH, blocked_plugins=("joshua-dataset",))
    (missing,) = examine(request).errors
    assert missing.code == "plugin-missing"
    assert "requires the plugin joshua-dataset" in missing.message
    for kind in ("FORMAT_CSV", "FORMAT_JSONL", "FORMAT_PARQUET"):
        path.write_text(dataset_file().replace("FORMAT_HUGGINGFACE", kind))
        assert not examine(Request(str(path), purpose=Purpose.LAUNCH)).errors


def test_only_the_simulation_mode_makes_episodes(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    arm = (
        'robot { actions { node { node_name: "arm" node_id: 1 publishers { data_type: JOINT_STATE '
        'topic_name: "/arm" publish_rate_hz: 50 } } action_type: ACTION_SINGLE sim_config { } } }'
    )
    path.write_text(dataset_file().replace("MODE_SIMULATION", "MODE_TEST") + arm)
    found = examine(Request(str(path)))
    assert "simulation.generate" in [d.field_path for d in found.diagnostics if d.code == "block-unused"]
    (simulator,) = [node for node in found.plan.nodes if node.name == "simulation"]
    assert simulator.settings["generate"] is None


def test_generated_episodes_belong_to_offscreen(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(dataset_file().replace("mode: OFFSCREEN", "mode: INTERACTIVE"))
    (error,) = examine(Request(str(path), purpose=Purpose.VALIDATE)).errors
    assert "pisodes are made only with mode: OFFSCREEN" in error.message
