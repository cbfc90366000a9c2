"""Files that stand in place of large ones are recognised, with the command that fetches them."""

from __future__ import annotations

import subprocess
from pathlib import Path

from joshua.plan.lfs import describe_pointer, describe_pointers, is_lfs_pointer

POINTER = (
    "version https://git-lfs.github.com/spec/v1\n"
    "oid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1258daaa5e2ca24d17e2393\n"
    "size 12345\n"
)


def test_a_pointer_in_a_clone_names_the_command_that_fetches_it(tmp_path: Path):
    subprocess.run(["git", "init", "-q", str(tmp_path / "a clone")], check=True)
    path = tmp_path / "a clone" / "policies" / "model.safetensors"
    path.parent.mkdir()
    path.write_text(POINTER)
    described = describe_pointer(path)
    assert described is not None
    message, remedy = described
    assert message == f"{path} is a Git LFS pointer: the repository was cloned without its large files"
    assert remedy == f"Run git -C '{tmp_path}/a clone' lfs pull --include policies/model.safetensors"


def test_a_pointer_outside_of_a_clone_has_to_be_cloned_again(tmp_path: Path):
    path = tmp_path / "mesh.stl"
    path.write_text(POINTER)
    described = describe_pointer(path)
    assert described is not None
    assert described[1] == "Run git lfs install, then clone the repository that it came from again"


def test_other_files_are_none(tmp_path: Path):
    for name, content in (
        ("empty", b""),
        ("text", b"version 1\n"),
        ("large", POINTER.encode() + bytes(2000)),
    ):
        (tmp_path / name).write_bytes(content)
        assert not is_lfs_pointer(tmp_path / name)
    assert not is_lfs_pointer(tmp_path / "missing")
    assert not is_lfs_pointer(tmp_path)


def test_several_pointers_of_a_folder_have_one_remedy(tmp_path: Path):
    subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)
    folder = tmp_path / "robots" / "arm"
    folder.mkdir(parents=True)
    paths = [folder / "base.stl", folder / "link.stl", folder / "read.me"]
    for path in paths[:2]:
        path.write_text(POINTER)
    paths[2].write_text("of a user")
    described = describe_pointers(folder, paths)
    assert described is not None
    message, remedy = described
    assert message.startswith(f"2 files of {folder} are Git LFS pointers, {paths[0]} first")
    assert remedy == f"Run git -C {tmp_path} lfs pull --include robots/arm"
    described = describe_pointers(tmp_path, paths)
    assert described is not None
    assert described[1] == f"Run git -C {tmp_path} lfs pull"
    assert describe_pointers(folder, paths[:1]) == describe_pointer(paths[0])
    assert describe_pointers(folder, paths[2:]) is None
