"""Files and folders of the owner alone, whatever the umask is."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from joshua.plan.private_files import create_private, make_private, private_opener


@pytest.fixture(params=[0o000, 0o022, 0o077, 0o277], ids=oct)
def umask(request: pytest.FixtureRequest) -> Iterator[None]:
    former = os.umask(request.param)
    yield
    os.umask(former)


def mode(path: Path) -> int:
    return path.stat().st_mode & 0o777


@pytest.mark.usefixtures("umask")
def test_new_folders_are_private_and_existing_ones_stay(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    make_private(tmp_path / "a/b")
    make_private(tmp_path / "a/b")
    assert (mode(tmp_path / "a"), mode(tmp_path / "a/b")) == (0o700, 0o700)
    assert mode(tmp_path) == 0o755


def test_a_file_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("")
    for folder in ("a", "a/b"):
        with pytest.raises(NotADirectoryError, match=str(tmp_path / "a")):
            make_private(tmp_path / folder)


@pytest.mark.parametrize("mask", [0o000, 0o022, 0o077], ids=oct)
def test_new_files_are_private(tmp_path: Path, mask: int) -> None:
    former = os.umask(mask)
    try:
        with open(tmp_path / "opened", "w", opener=private_opener) as file:
            file.write("x")
        create_private(tmp_path / "created")
        (tmp_path / "public").write_text("kept")
        (tmp_path / "public").chmod(0o644)
        create_private(tmp_path / "public")
    finally:
        os.umask(former)
    assert {path.name: oct(mode(path)) for path in tmp_path.iterdir()} == dict.fromkeys(
        ("opened", "created", "public"), "0o600"
    )
    assert (tmp_path / "public").read_text() == "kept"
