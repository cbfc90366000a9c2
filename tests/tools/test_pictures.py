"""The pictures of the documentation: each guide has one, each file is made by a script, and all are small."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import draw_chunks
import draw_diagrams
import draw_evaluation
import draw_learning_curve
import draw_middle_pose
import draw_pictures
import draw_rooms
import pytest
from PIL import Image

DOCS = Path(__file__).resolve().parents[2] / "docs"
IMAGES = DOCS / "images"
PAGES = [*sorted(DOCS.glob("*.md")), *sorted(DOCS.glob("guides/*.md"))]
MADE = {
    *draw_pictures.PICTURES,
    *draw_diagrams.DIAGRAMS,
    "imitation-curves.svg",  # a training draws it at its end
    draw_rooms.PICTURE.name,
    draw_chunks.PICTURE.name,
    draw_evaluation.PICTURE.name,
    draw_learning_curve.PICTURE.name,
    *(path.name for path in draw_middle_pose.PICTURES),
}
PICTURE = re.compile(r'!\[(.+?)\]\((\S+?)\)|(?:src|srcset)="(\S+?)"', re.DOTALL)


def pictures_of(page: Path) -> list[Path]:
    text = page.read_text(encoding="utf-8")
    return [(page.parent / (place or source)).resolve() for _, place, source in PICTURE.findall(text)]


@pytest.mark.parametrize("page", sorted(DOCS.glob("guides/*.md")), ids=lambda page: page.stem)
def test_each_guide_has_a_picture(page: Path) -> None:
    assert pictures_of(page), f"add a scene to tools/draw_pictures.py and show it in {page.name}"


def test_each_picture_of_a_page_exists_and_each_file_is_shown() -> None:
    shown = {picture for page in PAGES for picture in pictures_of(page)}
    assert shown == set(IMAGES.iterdir())


def test_each_file_is_named_by_the_script_that_makes_it() -> None:
    assert {path.name for path in IMAGES.iterdir()} == MADE


@pytest.mark.parametrize("picture", sorted(IMAGES.iterdir()), ids=lambda path: path.name)
def test_a_picture_is_small_and_says_what_it_shows(picture: Path) -> None:
    assert picture.stat().st_size < 200_000
    if picture.suffix == ".svg":
        assert re.search(r"<title>.{20,}</title>|aria-label=\".{20,}\"", picture.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", ["mistake.svg", "new-plugin.svg", "arm.webp", "models.webp"])
def test_a_picture_that_needs_no_run_is_up_to_date(name: str) -> None:
    if name.endswith(".webp") and (reason := opengl_problem()):
        pytest.skip(reason)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    # A process of its own: MuJoCo chooses its OpenGL when it is imported, which another test may have done.
    command = [sys.executable, draw_pictures.__file__, "--check", name]
    checked = subprocess.run(
        command,
        env=os.environ | {"PATH": path, "MUJOCO_GL": "egl"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout + checked.stderr


def opengl_problem() -> str:
    """Why nothing can be rendered here; "" where it can."""
    code = "import mujoco; mujoco.GLContext(8, 8).make_current()"
    environment = os.environ | {"MUJOCO_GL": "egl"}
    drawn = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=False)
    return "no OpenGL here: sudo apt install libegl1 libgl1-mesa-dri" if drawn.returncode else ""


def test_pictures_that_show_something_else_are_told_apart(tmp_path: Path) -> None:
    one, other = tmp_path / "one.svg", tmp_path / "other.svg"
    one.write_text("<text x='1'>$ joshua status 12.5 Hz in /tmp/robot-ab_1</text>")
    other.write_text("<text x='1'>$ joshua status 99 Hz in /tmp/robot-z</text>")
    assert draw_pictures.same(one, other)
    other.write_text("<text x='1'>$ joshua list 99 Hz in /tmp/robot-z</text>")
    assert not draw_pictures.same(one, other)
    colours = {"a": "#263238", "b": "#27333a", "c": "#604040"}
    for name, colour in colours.items():
        Image.new("RGB", (80, 60), colour).save(tmp_path / f"{name}.png")
    assert draw_pictures.same(tmp_path / "a.png", tmp_path / "b.png")
    assert not draw_pictures.same(tmp_path / "a.png", tmp_path / "c.png")


@pytest.mark.parametrize("name", draw_diagrams.DIAGRAMS)
def test_the_diagrams_are_up_to_date(name: str) -> None:
    drawn = draw_diagrams.DIAGRAMS[name]()
    assert (IMAGES / name).read_text(encoding="utf-8") == drawn, "run python tools/draw_diagrams.py"
