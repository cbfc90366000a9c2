"""Names and paths that come from elsewhere: what may become a path, and what each refusal says."""

from __future__ import annotations

import os
import string
from pathlib import Path

import hostile
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.plan.safe_paths import (
    UnsafePathError,
    check_distinct,
    file_inside,
    filled,
    inside,
    name_fault,
    name_inside,
    remove_tree,
    safe_name,
    tree_inside,
)


@pytest.mark.parametrize("name", hostile.NAMES.values(), ids=hostile.NAMES)
def test_a_hostile_name_is_refused(name: str) -> None:
    with pytest.raises(
        UnsafePathError, match=r"^the camera ['\"].*['\"] cannot be a file name: \S"
    ) as refused:
        safe_name(name, "the camera")
    message = str(refused.value)
    assert message.isprintable(), "the message contains what it refuses"
    assert len(message) < 1500


@pytest.mark.parametrize(
    "name",
    [
        *("observation.images.top", "action", "observation.state", "camera_1", "2024-11-26-act", "über"),
        *("カメラ", "camera (left)", "lr=0.001, seed=3", "a+b", "so101_follower.white", "_", "9"),
    ],
)
def test_an_ordinary_name_is_allowed(name: str) -> None:
    assert safe_name(name) == name


@given(st.text(max_size=40))
def test_no_allowed_name_leaves_its_folder_or_its_line(name: str) -> None:
    if name_fault(name):
        return
    assert name.isprintable()
    assert Path("folder", name).parts == ("folder", name)
    assert os.path.normpath(f"folder/{name}") == f"folder/{name}"
    assert not set(name) & set("/\\:*?\"'<>|{}`$;&!%[]")


@given(st.text(alphabet=string.printable, max_size=30))
def test_a_path_stays_inside_or_is_refused(text: str) -> None:
    folder = Path("/somewhere/set")
    try:
        found = inside(folder, text)
    except UnsafePathError:
        return
    assert Path(os.path.normpath(found)).is_relative_to(folder)


def test_names_that_differ_only_in_case_are_refused() -> None:
    check_distinct(["top", "side"])
    with pytest.raises(UnsafePathError, match="the features 'top' and 'Top' are the same file on some disks"):
        check_distinct(["top", "Top"], "the features")
    with pytest.raises(UnsafePathError, match="rename one of them"):
        check_distinct(["straße", "STRASSE"])


def test_templates_take_only_names_and_widths() -> None:
    values: dict[str, int | str] = {"chunk_index": 7, "video_key": "observation.images.top"}
    found = filled("videos/{video_key}/chunk-{chunk_index:03d}/file-{chunk_index}.mp4", values)
    assert found == "videos/observation.images.top/chunk-007/file-7.mp4"
    with pytest.raises(
        UnsafePathError, match=r"has the field '\{chunk_index!r}'|has the field '\{'"
    ) as refused:
        filled("data/{chunk_index!r}", values)
    assert "Allowed: {chunk_index}, {video_key}, integers with a width such as :03d" in str(refused.value)
    with pytest.raises(UnsafePathError):
        filled("data/{video_key:03d}", values)


@pytest.mark.parametrize("template", hostile.TEMPLATES.values(), ids=hostile.TEMPLATES)
def test_a_hostile_template_is_refused(tmp_path: Path, template: str) -> None:
    with pytest.raises(UnsafePathError) as refused:
        inside(tmp_path, filled(template, {"chunk_index": 0, "file_index": 0}))
    assert str(refused.value).isprintable()


def test_symlinks_lead_inside_or_are_refused(tmp_path: Path) -> None:
    folder, other = tmp_path / "set", tmp_path / "other"
    (folder / "data").mkdir(parents=True)
    other.mkdir()
    (folder / "alias").symlink_to("data")
    assert inside(folder, "alias/file") == folder / "alias/file"
    (folder / "away").symlink_to(other)
    with pytest.raises(
        UnsafePathError, match=r"'.*away/file' is a symlink that leads outside .*Replace it by"
    ):
        inside(folder, "away/file")
    (folder / "dangling").symlink_to(other / "not there")
    with pytest.raises(UnsafePathError, match="leads outside"):
        inside(folder, "dangling")
    (folder / "loop").symlink_to("loop")
    with pytest.raises(UnsafePathError, match="cannot be followed"):
        inside(folder, "loop/file")
    (tmp_path / "link").symlink_to(folder)
    assert inside(tmp_path / "link", "data/file") == tmp_path / "link/data/file"


def test_a_path_below_the_folder_may_be_absolute(tmp_path: Path) -> None:
    assert inside(tmp_path, tmp_path / "data/file") == tmp_path / "data/file"
    with pytest.raises(UnsafePathError, match=r"the video '/etc/passwd' is outside"):
        inside(tmp_path, "/etc/passwd", "the video")


def test_a_folder_may_be_relative_to_the_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data/pipe").symlink_to("/dev/zero")
    monkeypatch.chdir(tmp_path)
    folder = Path("data")
    assert inside(folder, folder / "meta/info.json") == Path("data/meta/info.json")
    assert inside(folder, "data/file-000.parquet") == Path("data/data/file-000.parquet")
    assert inside(Path(), Path("data")) == Path("data")
    for check in (inside, file_inside):
        with pytest.raises(UnsafePathError, match="leads outside data"):
            check(folder, folder / "pipe")
    with pytest.raises(UnsafePathError, match="is outside data"):
        inside(folder, Path("data/../other"))


def test_a_name_that_is_replaced_may_be_a_link(tmp_path: Path) -> None:
    folder, other = tmp_path / "set", tmp_path / "other"
    (folder / "data").mkdir(parents=True)
    other.mkdir()
    (folder / "data/file").symlink_to(other / "file")
    assert name_inside(folder, "data/file") == folder / "data/file"
    (folder / "videos").symlink_to(other)
    assert name_inside(folder, "videos") == folder / "videos"
    with pytest.raises(UnsafePathError, match="leads outside"):
        name_inside(folder, "videos/file")
    for name in ("..", "data/..", "", ".", "/etc/passwd", "../other/file"):
        with pytest.raises(UnsafePathError):
            name_inside(folder, name)
    with pytest.raises(UnsafePathError, match="control character"):
        name_inside(folder, "data/new\nline")


def test_only_ordinary_files_are_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(UnsafePathError, match=r"'.*pipe' is a pipe, not a file"):
        file_inside(tmp_path, "pipe")
    with pytest.raises(UnsafePathError, match="is a folder, not a file"):
        file_inside(tmp_path.parent, tmp_path)
    assert file_inside(tmp_path, "missing") == tmp_path / "missing"


def test_a_tree_is_read_only_if_all_of_it_is_inside(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    (folder / "images/deep").mkdir(parents=True)
    assert tree_inside(folder, "images") == folder / "images"
    (folder / "images/deep/frame.png").symlink_to(tmp_path / "secret")
    with pytest.raises(UnsafePathError, match=r"frame\.png' is a symlink that leads outside"):
        tree_inside(folder, "images")


def test_a_tree_is_removed_without_following_its_links(tmp_path: Path) -> None:
    folder, other = tmp_path / "set", tmp_path / "other"
    (folder / "images").mkdir(parents=True)
    hostile.fill(other)
    before = hostile.manifest(other)
    (folder / "images/link").symlink_to(other)
    remove_tree(folder, "images")
    assert not (folder / "images").exists()
    (folder / "images").symlink_to(other)
    with pytest.raises(UnsafePathError, match="leads outside"):
        remove_tree(folder, "images")
    assert hostile.manifest(other) == before
