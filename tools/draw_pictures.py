"""Draws the pictures of the documentation that show JOSHUA at work: terminals, renders, the page, plots.

Everything comes from real runs on emulated devices and simulated robots. Name some on the command line, or
none for all. With ``--check`` none is replaced: those that would look different now are named. It needs every
plugin, the group ``pictures``, OpenGL, and chromium.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from PIL import Image, ImageChops, ImageDraw, ImageFont, ImageStat
from terminal_picture import Type, moving, record, still

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ROOT / "docs" / "images"
STATE = Path("/tmp/state")  # it is shown, so it is short
CTRL_C = "\x03"
WIDE, NARROW = 80, 50
#: Mean difference of two pictures that count as the same, of 255: another OpenGL draws other edges.
LARGEST_DIFFERENCE = 6.0
JOSHUA = "joshua --config"


@dataclass(frozen=True)
class Terminal:
    """A picture of a terminal: what is typed, and which lines are shown (see ``still``)."""

    title: str
    steps: tuple[Type, ...]
    before: tuple[str, ...] = ()
    after: str = "true"
    start: str = ""
    end: str = ""
    columns: int = 72


def emulated(preset: str, *options: str) -> Type:
    """Return the line that runs a copy of a preset on emulated devices."""
    return Type(" ".join((JOSHUA, f"{preset}.pbtxt", "--emulate", *options)))


def in_background(preset: str) -> str:
    """Return the line that starts such a run and waits until its nodes are ready."""
    ready = "until grep -q 'nodes ready' log 2>/dev/null; do sleep 0.2; done"
    return f"{JOSHUA} {preset}.pbtxt --emulate >log 2>&1 & {ready}"


SESSION = (
    Type("joshua new my_robot --from teleop_so_arm100"),
    Type(f"{JOSHUA} my_robot.pbtxt --set general.mode=MODE_TELEOPERAT"),
    Type(f"{JOSHUA} my_robot.pbtxt --emulate", until="stop with", linger_s=4, then=CTRL_C),
)
TERMINALS = {
    "mistake.svg": Terminal(
        "A misspelt mode: the message names the file, the line, the nearest allowed value and the next step",
        (
            Type("sed -i s/MODE_TEST/MODE_TSET/ demo.pbtxt"),
            Type(f"{JOSHUA} demo.pbtxt --validate-only"),
        ),
        before=("joshua new demo --from test_mock_hardware",),
    ),
    "data-set-check.svg": Terminal(
        "A data set lacks its table of tasks: the check names it, the repair makes it anew from the episodes",
        (
            Type("rm demos/meta/tasks.parquet"),
            Type("joshua dataset check demos"),
            Type("joshua dataset repair demos"),
        ),
        before=(
            f'PYTHONPATH={ROOT}/tests/support python -c "from pathlib import Path; import small_dataset; '
            "small_dataset.write(Path('demos'), lengths=(3, 2))\"",
        ),
    ),
    "foreign-model.svg": Terminal(
        "joshua models names what of a model can be driven, its ranges, and a block for the file",
        (Type("joshua models ant/ant.xml"),),
    ),
    "checkpoint.svg": Terminal(
        "A checkpoint knows another camera than the robot has: the message names both, and the rename",
        (
            Type("joshua policy show act"),
            Type(f"{JOSHUA} robot.pbtxt --validate-only"),
        ),
        before=(
            f'PYTHONPATH={ROOT}/tests/support python -c "from pathlib import Path; import checkpoints as c; '
            "c.write_checkpoint(Path('act'), cameras={'top': (640, 480)}); "
            "c.write_robot(Path('robot.pbtxt'), 'act', cameras={'front': (640, 480)})\"",
            # A model with an interpreter of its own: what this one lacks is no part of the picture.
            "sed -i 's|node_id: 2|& python: \"policies/bin/python\"|' robot.pbtxt",
            'mkdir -p policies/bin && ln -s "$(command -v python)" policies/bin/python',
        ),
    ),
    "encoders.svg": Terminal(
        "The end of a run with three emulated encoders: every check passes",
        (emulated("wheel_encoders", "--duration 4"),),
        before=(f"cp {ROOT}/docs/examples/wheel_encoders.pbtxt .",),
        start="ended:",
    ),
    "koch.svg": Terminal(
        "A Koch leader of Dynamixel servos drives an SO-100 follower, both emulated",
        (emulated("koch_leads_so_arm100", "--duration 4"),),
        before=(f"cp {ROOT}/docs/examples/koch_leads_so_arm100.pbtxt .",),
        start="koch_leads_so_arm100.pbtxt · ",
        end="jitter percentiles",
    ),
    "new-plugin.svg": Terminal(
        "joshua new-plugin writes a sensor, and explain shows its block",
        (
            Type("joshua new-plugin acme-sonar --kind sensor"),
            Type("ls acme-sonar acme-sonar/src/acme_sonar"),
            Type("tail -n 22 acme-sonar/src/acme_sonar/plugin.py"),
        ),
    ),
    "status.svg": Terminal(
        "joshua status shows the nodes of a run; joshua estop takes the torque off",
        (
            Type("joshua status"),
            Type("joshua estop my_arms.pbtxt"),
            Type("joshua estop --release"),
            Type("joshua resume follower_arm"),
        ),
        after="joshua stop",
        before=(
            "joshua new my_arms --from teleop_so_arm100",
            in_background("my_arms"),
        ),
    ),
    "spike.svg": Terminal(
        "The end of a test of an emulated hub with two motors: every check passes",
        (emulated("test_spike_ble", "--duration 4"),),
        before=("joshua new test_spike_ble --from test_spike_ble",),
        start="ended:",
        end="data:",
    ),
    "keyboard.svg": Terminal(
        "The keys of the keyboard preset, and the status line while a joint is driven",
        (
            Type(
                f"{JOSHUA} teleop_keyboard.pbtxt --emulate",
                until="stop with",
                linger_s=2,
                then="? " + "d" * 12 + CTRL_C,
            ),
        ),
        before=("joshua new teleop_keyboard --from teleop_keyboard",),
        start="ready after",
        end="jitter percentiles",
    ),
    "inference.svg": Terminal(
        "A model that acts at random drives an emulated arm with two cameras",
        (emulated("inference_random_noise", "--duration 4"),),
        before=("joshua new inference_random_noise --from inference_random_noise",),
        start="inference_random_noise.pbtxt · ",
        end="stopping:",
    ),
    "graph.svg": Terminal(
        "joshua node and joshua topic look into a running graph",
        (
            Type("joshua node list"),
            Type("joshua topic list --types"),
            Type("joshua topic hz /follower/joint_states --count 2"),
            Type("joshua topic echo /follower/joint_states --once"),
        ),
        after="joshua stop",
        before=(
            "joshua new my_arms --from teleop_so_arm100",
            in_background("my_arms"),
        ),
    ),
    "recording.svg": Terminal(
        "joshua record keeps two episodes, and joshua dataset info describes the data set",
        (Type("joshua dataset info datasets/so_arm100_demos"),),
        before=(
            "joshua new my_data --from data_store_record",
            in_background("my_data"),
            *("joshua record start; sleep 3; joshua record keep",) * 2,
            "joshua stop; wait",
        ),
    ),
}


def draw_terminal(name: str) -> None:
    """Run a scene in a folder of its own, and draw the terminal."""
    scene = TERMINALS[name]
    with tempfile.TemporaryDirectory(prefix="robot-") as folder:
        for line in scene.before:
            subprocess.run(["bash", "-c", line], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        recording = record(scene.steps, columns=scene.columns, folder=Path(folder))
        subprocess.run(["bash", "-c", scene.after], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    IMAGES.joinpath(name).write_text(still(recording, title=scene.title, start=scene.start, end=scene.end))


def draw_session(name: str, columns: int, lines: int) -> None:
    """Draw the session of the first page in motion."""
    title = "A preset is copied, a mistake is explained, and two emulated arms run until Ctrl-C"
    with tempfile.TemporaryDirectory(prefix="robot-") as folder:
        recording = record(SESSION, columns=columns, folder=Path(folder), rows=lines)
    IMAGES.joinpath(name).write_text(moving(recording, title=title, lines=lines))


def draw_from_run(name: str, preset: str, pattern: str, width: int) -> None:
    """Keep the picture that a test leaves beside its log."""
    with tempfile.TemporaryDirectory(prefix="robot-") as folder:
        line = f"joshua new robot --from {preset} && {JOSHUA} robot.pbtxt --emulate --duration 6"
        subprocess.run(["bash", "-c", line], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    newest = max((STATE / "joshua" / "log").glob(pattern), key=lambda path: path.stat().st_mtime)
    with Image.open(newest) as picture:
        save(picture.convert("RGB"), name, width)


def save(picture: Image.Image, name: str, width: int) -> None:
    """Write a picture at a width, as small as its kind allows."""
    if picture.width > width:
        picture = picture.resize(
            (width, round(picture.height * width / picture.width)), Image.Resampling.LANCZOS
        )
    if name.endswith(".png"):
        picture = picture.quantize(128, dither=Image.Dither.NONE)
    picture.save(IMAGES / name, optimize=True, quality=82, method=6)


def render(model: str, size: tuple[int, int], look: tuple[float, ...] | str) -> Image.Image:
    """Draw a model of the simulation in its pose ``home``.

    Args:
        look: azimuth, elevation, distance and the point in the middle, or the name of a camera.
    """
    import mujoco
    from joshua_mujoco_sim.catalog import find_packaged

    physics = mujoco.MjModel.from_xml_path(str(find_packaged(model)))
    # Drawn larger than it is kept, for smooth edges.
    width, height = physics.vis.global_.offwidth, physics.vis.global_.offheight = size[0] * 2, size[1] * 2
    data = mujoco.MjData(physics)
    mujoco.mj_resetDataKeyframe(physics, data, physics.key("home").id)
    mujoco.mj_forward(physics, data)
    camera = mujoco.MjvCamera()
    if not isinstance(look, str):
        camera.azimuth, camera.elevation, camera.distance = look[:3]
        camera.lookat[:] = look[3:]
    with mujoco.Renderer(physics, height, width) as renderer:
        renderer.update_scene(data, look if isinstance(look, str) else camera)
        return Image.fromarray(renderer.render()).resize(size, Image.Resampling.LANCZOS)


def draw_arm(name: str) -> None:
    """Draw the arm of the first page."""
    save(render("so_arm100/pick_place.xml", (1200, 520), (205, -14, 0.62, 0.0, -0.17, 0.09)), name, 1200)


ARM = (215.0, -16.0, 0.72, 0.0, -0.16, 0.1)
MODELS: dict[str, tuple[str, tuple[float, ...] | str]] = {
    "so_arm100/scene.xml": ("so_arm100/scene.xml", ARM),
    "so_arm100/reach.xml": ("so_arm100/reach.xml", ARM),
    "so_arm100/pick_place.xml": ("so_arm100/pick_place.xml", ARM),
    "so_arm100/pick_place.xml, camera top": ("so_arm100/pick_place.xml", "top"),
    "lekoch/scene.xml": ("lekoch/scene.xml", (140.0, -16.0, 1.0, 0.1, 0.0, 0.16)),
    "ant/ant.xml": ("ant/ant.xml", (120.0, -22.0, 3.6, 0.0, 0.0, 0.5)),
}


def draw_models(name: str) -> None:
    """Draw the models that come with the plugin, with their names, and what the camera ``top`` sees."""
    width, height, bar = 400, 260, 26
    sheet = Image.new("RGB", (width * 2, (height + bar) * 3), "#263238")
    draw = ImageDraw.Draw(sheet)
    for index, (label, (model, look)) in enumerate(MODELS.items()):
        left, top = index % 2 * width, index // 2 * (height + bar)
        sheet.paste(render(model, (width, height), look), (left, top))
        draw.text((left + 10, top + height + 5), label, "#eceff1", ImageFont.load_default(14))
    save(sheet, name, 800)


def draw_demonstration(name: str) -> None:
    """Draw some moments of a demonstration as the cameras ``work`` and ``wrist`` show them to a policy."""
    from joshua_mujoco_sim.envs import make_environment
    from joshua_mujoco_sim.envs.experts import EXPERTS

    task, cameras, (width, height) = "joshua/SoArm100PickPlace-v0", ("work", "wrist"), (64, 48)
    environment = make_environment(
        task, observation_mode="pixels", cameras=cameras, width=width, height=height, disable_env_checker=True
    ).unwrapped
    expert = EXPERTS[task](environment)
    seen, _ = environment.reset(seed=2)
    expert.reset()
    shown, ended = [seen], False
    while not ended:
        seen, _, ended, _, _ = environment.step(expert.act())
        shown.append(seen)
    environment.close()
    moments = [round(at * (len(shown) - 1)) for at in (0.0, 0.25, 0.4, 0.6, 0.8, 1.0)]
    sheet = Image.new("RGB", (width * len(moments), height * len(cameras)))
    for column, moment in enumerate(moments):
        for row, camera in enumerate(cameras):
            sheet.paste(Image.fromarray(shown[moment][camera]), (column * width, row * height))
    save(sheet.resize((3 * sheet.width, 3 * sheet.height), Image.Resampling.NEAREST), name, 3 * sheet.width)


def draw_page(name: str) -> None:
    """Photograph the page of a calibration at its first step, which shows the middle pose."""
    with tempfile.TemporaryDirectory(prefix="robot-") as folder:
        robot = "calibrate_so_arm100"
        subprocess.run(["joshua", "new", robot, "--from", robot], cwd=folder, check=True)
        line = f"joshua calibrate --config {robot}.pbtxt --emulate --node leader_arm --open"

        def photograph(shown: bytes) -> None:
            address = re.search(rb"page: (http\S+)", shown)
            assert address is not None
            picture = Path(folder) / "page.png"
            options = (
                "--headless",
                "--no-sandbox",
                "--hide-scrollbars",
                "--window-size=1040,980",
                "--timeout=3000",
            )
            command = ["chromium", *options, f"--screenshot={picture}", address[1].decode()]
            subprocess.run(command, check=True, capture_output=True, timeout=60)
            with Image.open(picture) as page:
                save(page.convert("RGB"), name, 1040)

        step = Type(line, until="page: http", linger_s=4, look=photograph)
        record((step,), columns=WIDE, folder=Path(folder))


PICTURES: dict[str, Callable[[str], None]] = {
    "arm.webp": draw_arm,
    "session.svg": lambda name: draw_session(name, WIDE, 26),
    "session-narrow.svg": lambda name: draw_session(name, NARROW, 26),
    "models.webp": draw_models,
    "demonstration.webp": draw_demonstration,
    "calibration-page.png": draw_page,
    "camera-picture.webp": lambda name: draw_from_run(name, "test_camera", "camera-*.jpg", 640),
    "lidar-scan.png": lambda name: draw_from_run(name, "test_lidar", "lidar-*.png", 700),
    "test-single-motor.png": lambda name: draw_from_run(name, "test_single_motor", "*-servo.png", 1000),
    **dict.fromkeys(TERMINALS, draw_terminal),
}


def stale(names: Iterable[str]) -> list[str]:
    """Draw pictures elsewhere, and name those that differ from the ones in the documentation."""
    global IMAGES
    kept, found = IMAGES, []
    with tempfile.TemporaryDirectory() as folder:
        IMAGES = Path(folder)
        try:
            for name in names:
                PICTURES[name](name)
                if not same(kept / name, IMAGES / name):
                    found.append(name)
        finally:
            IMAGES = kept
    return found


def same(one: Path, other: Path) -> bool:
    """Whether two pictures show the same: the words of a terminal but numbers, about the same colours."""
    if one.suffix == ".svg":
        return words(one.read_text(encoding="utf-8")) == words(other.read_text(encoding="utf-8"))
    with Image.open(one) as first, Image.open(other) as second:
        if abs(first.height / first.width - second.height / second.width) > 0.01:
            return False
        small = (picture.convert("RGB").resize((32, 32), Image.Resampling.BOX) for picture in (first, second))
        mean = ImageStat.Stat(ImageChops.difference(*small)).mean
    return max(mean) < LARGEST_DIFFERENCE


def words(svg: str) -> list[str]:
    """The words of a terminal, without what differs from run to run."""
    texts = re.findall(r"<text[^>]*>([^<]*)</text>", svg)
    return re.sub(r"/tmp/robot-\w+|[\d.]*\d", "#", " ".join(texts)).split()


def main(names: list[str]) -> int:
    """Draw the named pictures, or all, and return the exit code."""
    os.environ |= {"XDG_STATE_HOME": str(STATE), "MUJOCO_GL": os.environ.get("MUJOCO_GL", "egl")}
    chosen = [name for name in names if name != "--check"] or list(PICTURES)
    if "--check" in names:
        old = stale(chosen)
        sys.stdout.writelines(
            f"{name} is out of date: python tools/draw_pictures.py {name}\n" for name in old
        )
        return 1 if old else 0
    for name in chosen:
        PICTURES[name](name)
        sys.stdout.write(f"{name}: {(IMAGES / name).stat().st_size} bytes\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
