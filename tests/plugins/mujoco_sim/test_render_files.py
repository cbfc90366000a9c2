"""Pictures in files: the right number, at the right times, the same every time."""

from __future__ import annotations

import hashlib
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import av
import pytest
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
from joshua.testing.domain import reserved_domain
from joshua.testing.port import free_port
from joshua_mujoco_sim.opengl import RenderingError, choose_gl
from joshua_mujoco_sim.render_files import RenderFile
from joshua_mujoco_sim.settings_parts import Render
from joshua_mujoco_sim.world import World, WorldSettings
from sim_configs import simulation_file


@pytest.fixture(autouse=True)
def rendering() -> None:
    try:
        choose_gl()
    except RenderingError as error:
        pytest.skip(f"no picture can be drawn here: {error}")


def record(folder: Path, name: str, steps: int = 100) -> list[Path]:
    """A fifth of a second of the arm on its way, at 20 pictures a second."""
    world = World(WorldSettings("so_arm100/scene.xml", real_time_factor=0))
    render = Render(camera="top", width=96, height=64, fps=20, output=str(folder / "out" / name))
    file = RenderFile(world, render)
    file.open()
    file.begin()
    with world.lock:
        world.physics.group(()).set_command(world.physics.group(()).range_max_rad)
        world.advance(steps)
    assert not file.error
    file.close()
    return sorted((folder / "out").iterdir())


def test_png_files_are_numbered_and_the_same_every_time(tmp_path: Path) -> None:
    first, second = (record(tmp_path / run, "top_%03d.png") for run in ("a", "b"))
    assert [path.name for path in first] == [f"top_{n:03d}.png" for n in range(4)]
    digests = [[hashlib.sha256(p.read_bytes()).hexdigest() for p in paths] for paths in (first, second)]
    assert digests[0] == digests[1]
    assert len(set(digests[0])) > 1  # the arm moves


def test_pictures_go_on_after_a_reset(tmp_path: Path) -> None:
    world = World(WorldSettings("so_arm100/scene.xml", real_time_factor=0))
    render = Render(camera="top", width=32, height=32, fps=20, output=str(tmp_path / "top_%03d.png"))
    file = RenderFile(world, render)
    with world.lock:
        world.advance(30)  # 60 ms, before anybody draws
        file.open()
        file.begin()
        world.advance(40)
        assert file.count == 1  # at 100 ms
        world.physics.reset()
        world.advance(30)
    assert file.count == 3  # at 0 and 50 ms
    file.close()


def test_video_has_every_picture(tmp_path: Path) -> None:
    (path,) = record(tmp_path, "top.mp4", steps=500)
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        assert stream.average_rate == 20
    assert len(frames) == 20
    assert frames[0].shape == (64, 96, 3)
    assert frames[0].std() > 10


def test_full_disk_is_named_and_ends_nothing_else(tmp_path: Path) -> None:
    world = World(WorldSettings("so_arm100/scene.xml", real_time_factor=0))
    render = Render(camera="top", width=96, height=64, fps=500, output=str(tmp_path / "top.mp4"))
    file = RenderFile(world, render)
    file.open()
    file.begin()
    former = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300, former[1]))
    try:
        with world.lock:
            world.advance(100)
        file.close()
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, former[1]))
        with pytest.raises(OSError, match="File too large"):
            RenderFile(world, render)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, former)
    assert file.error.startswith(f"{tmp_path}/top.mp4: ")
    assert "File too large" in file.error


def test_whole_runs_with_the_same_seed_write_the_same_files(tmp_path: Path) -> None:
    runs = []
    with reserved_domain() as first, reserved_domain() as second:
        for domain in (first, second):
            path = tmp_path / str(domain) / "robot.pbtxt"
            path.parent.mkdir()
            path.write_text(
                'general { mode: MODE_SIMULATION name: "sim" id: "sim-test" }\n'
                'simulation { mode: OFFSCREEN model_path: "so_arm100/pick_place.xml" seed: 3 '
                'real_time_factor: 0 renders { camera: "front" width: 64 height: 48 fps: 10 '
                'output: "out/f_%04d.png" } }\n'
                f'transport {{ listen_endpoints: "tcp/localhost:{free_port()}" }}\n'
            )
            program = [sys.executable, "-m", "joshua.cli.main", "--config", str(path)]
            environment = os.environ | {"ROS_DOMAIN_ID": str(domain)}
            pipes: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
            runs.append((path.parent, subprocess.Popen(program, env=environment, **pipes)))
        end_s = time.monotonic() + 100
        while not all((folder / "out/f_0006.png").exists() or run.poll() is not None for folder, run in runs):
            assert time.monotonic() < end_s
            time.sleep(0.02)
        for _, run in runs:
            run.send_signal(signal.SIGINT)
        errors = [run.communicate(timeout=100)[1] for _, run in runs]
    pictures = []
    for (folder, run), text in zip(runs, errors, strict=True):
        assert run.returncode == 0, text
        files = {path.name: path.read_bytes() for path in (folder / "out").glob("f_*.png")}
        assert f"wrote {len(files)} pictures to {folder}/out/f_%04d.png" in text
        pictures.append(files)
    common = sorted(set.intersection(*map(set, pictures)))
    assert common[:5] == [f"f_{n:04d}.png" for n in range(5)]
    assert [pictures[0][name] for name in common] == [pictures[1][name] for name in common]


@pytest.mark.parametrize(
    ("render", "field", "text"),
    [
        ('camera: "tip" output: "a.mp4"', "renders[0].camera", "no camera named 'tip'"),
        ('camera: "top" output: "a.png"', "renders[0].output", "each picture needs its own"),
        ('camera: "top" output: "a.gif"', "renders[0].output", ".gif is not a supported picture format"),
        (
            'camera: "top" output: "a.mp4" } renders { width: 64 height: 48 fps: 10 camera: "front" '
            'output: "./a.mp4"',
            "renders[1].output",
            "renders[0] already writes a.mp4",
        ),
        (
            'camera: "top" output: "a.mp4" } renders { width: 64 height: 48 fps: 501 camera: "front" '
            'output: "b.mp4"',
            "renders[1].fps",
            "The model makes 500 steps per second and has no 501 different frames in one",
        ),
    ],
)
def test_bad_outputs_are_found_before_the_start(tmp_path: Path, render: str, field: str, text: str) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(simulation_file(simulation=f"renders {{ width: 64 height: 48 fps: 10 {render} }}"))
    (error,) = examine(Request(str(path), purpose=Purpose.VALIDATE)).errors
    assert error.field_path == f"simulation.{field}"
    assert text in error.message
