"""What stands at a path: every kind of file gives a text or a clear error, and nothing blocks."""

from __future__ import annotations

import os
import socket
import stat
from pathlib import Path

import pytest
from joshua.config import LoadedConfig, load
from joshua.plan import Diagnostic
from joshua.textproto.limits import MAX_FILE_BYTES


def only(loaded: LoadedConfig) -> Diagnostic:
    assert len(loaded.diagnostics) == 1, loaded.diagnostics
    return loaded.diagnostics[0]


def test_a_missing_file_names_its_neighbours(tmp_path: Path) -> None:
    (tmp_path / "teleop.pbtxt").touch()
    found = only(load(tmp_path / "telop.pbtxt"))
    assert (found.code, found.position) == ("file-missing", None)
    assert found.message == f"There is no file {tmp_path}/telop.pbtxt."
    assert found.allowed == (f"{tmp_path}/teleop.pbtxt",)
    assert found.remedy == (
        f"Did you mean {tmp_path}/teleop.pbtxt? `joshua presets` lists files to start from."
    )


def test_a_name_that_shares_the_suffix_alone_is_not_near(tmp_path: Path) -> None:
    for name in ("nul.pbtxt", "mine.pbtxt"):
        (tmp_path / name).touch()
    found = only(load(tmp_path / "nosuch.pbtxt"))
    assert found.allowed == ()
    assert found.remedy.startswith("Check the path")
    assert only(load(tmp_path / "main.pbtx")).allowed == (f"{tmp_path}/mine.pbtxt",)


def test_a_missing_suffix_is_noticed(tmp_path: Path) -> None:
    (tmp_path / "arm.pbtxt").touch()
    assert only(load(tmp_path / "arm")).allowed == (f"{tmp_path}/arm.pbtxt",)


def test_a_path_through_a_file_is_missing(tmp_path: Path) -> None:
    (tmp_path / "arm.pbtxt").touch()
    assert only(load(tmp_path / "arm.pbtxt" / "x")).code == "file-missing"


def test_a_folder_names_the_files_in_it(tmp_path: Path) -> None:
    (tmp_path / "b.pbtxt").touch()
    (tmp_path / "a.pbtxt").touch()
    loaded = load(tmp_path)
    found = only(loaded)
    assert found.code == "not-a-file"
    assert found.message == f"{tmp_path} is a folder, not a configuration file."
    assert found.allowed == (f"{tmp_path}/a.pbtxt", f"{tmp_path}/b.pbtxt")
    assert not loaded.is_readable


def test_a_pipe_is_not_opened(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    os.mkfifo(path)
    assert only(load(path)).message == f"{path} is a pipe, not a configuration file."


def test_a_device_is_not_opened() -> None:
    assert only(load("/dev/zero")).message == "/dev/zero is a device, not a configuration file."


def test_a_socket_is_not_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind("s")
        assert only(load("s")).message == "s is a socket, not a configuration file."


def test_an_unreadable_file_gives_the_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "secret.pbtxt"
    path.touch()

    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    # The tests may run as root, whom no permission stops.
    monkeypatch.setattr(os, "open", refuse)
    found = only(load(path))
    assert found.code == "file-unreadable"
    assert found.message == f"{path} cannot be read: Permission denied."
    assert "permissions" in found.remedy


def test_a_file_whose_permissions_forbid_it_is_refused(tmp_path: Path) -> None:
    if os.geteuid() == 0:
        pytest.skip("root reads every file")
    path = tmp_path / "secret.pbtxt"
    path.touch(mode=0)
    assert only(load(path)).code == "file-unreadable"


def test_a_loop_of_links_is_unreadable(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    found = only(load(tmp_path / "loop"))
    assert found.code == "file-unreadable"
    assert "symbolic links" in found.message


@pytest.mark.parametrize("path", ["", "a\0b", "x" * 5000])
def test_a_path_that_no_file_can_have(path: str) -> None:
    assert only(load(path)).code in ("file-missing", "file-unreadable")


def test_a_huge_file_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "huge.pbtxt"
    with path.open("wb") as file:
        file.truncate(100_000_000)  # sparse: reading it would show in memory, not on the disk
    found = only(load(path))
    assert found.code == "file-too-large"
    assert found.message == f"{path} has 100000000 bytes; a configuration may have at most 8 MiB."


def test_a_file_that_grows_past_the_limit_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "big.pbtxt"
    path.write_bytes(b"#" * (MAX_FILE_BYTES + 1))
    real_stat = Path.stat

    def small(self: Path, **options: bool) -> os.stat_result:
        found = list(real_stat(self, **options))
        found[stat.ST_SIZE] = 10
        return os.stat_result(found)

    monkeypatch.setattr(Path, "stat", small)
    assert only(load(path)).code == "file-too-large"


def test_a_file_of_too_many_words_stops_with_one_error(tmp_path: Path) -> None:
    path = tmp_path / "words.pbtxt"
    path.write_text("include: []\n" * 200_000)
    found = load(path).diagnostics
    assert [item.code for item in found] == ["file-too-large"]
    assert "contains more than 500000 words and signs" in found[0].message


def test_a_long_list_of_problems_is_cut(tmp_path: Path) -> None:
    path = tmp_path / "words.pbtxt"
    path.write_text("nothing: 1\n" * 5000)
    found = load(path).diagnostics
    assert len(found) == 1001
    assert found[-1].code == "too-many-problems"


def test_bytes_that_are_not_utf8_are_placed_and_the_rest_is_read(tmp_path: Path) -> None:
    path = tmp_path / "latin.pbtxt"
    path.write_bytes('general {\n  name: "é'.encode() + b'\xfc"\n  id: "x"\n  idd: "y"\n}\n')
    loaded = load(path)
    assert [(item.code, str(item.position)) for item in loaded.diagnostics] == [
        ("not-utf8", f"{path}:2:11"),
        ("unknown-field", f"{path}:4:3"),
    ]
    assert loaded.diagnostics[0].message == "The byte 0xfc is not UTF-8 text."
    assert loaded.config.general.id == "x"


def test_a_nul_byte_is_placed(tmp_path: Path) -> None:
    path = tmp_path / "nul.pbtxt"
    path.write_bytes(b'general {\n  id: "x\0"\n}\n')
    found = only(load(path))
    assert (found.code, str(found.position)) == ("nul-byte", f"{path}:2:9")


@pytest.mark.parametrize("data", [bytes(range(256)) * 10, b"\0" * 5000, b"\x7fELF" + b"\xff\x00" * 100])
def test_a_binary_file_gives_one_error(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "program"
    path.write_bytes(data)
    found = only(load(path))
    assert found.message == f"{path} is not a text file: many of its bytes are invalid in text."


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be"])
def test_utf16_is_named(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "wide.pbtxt"
    path.write_bytes(b"\xfe\xff" * (encoding == "utf-16-be") + "general { }".encode(encoding))
    assert only(load(path)).message == f"{path} is UTF-16 text; configurations are UTF-8."


def test_line_ends_of_windows_and_tabs_do_not_move_columns(tmp_path: Path) -> None:
    path = tmp_path / "crlf.pbtxt"
    path.write_bytes('general {\r\n\tname: "日本"\tidd: 1\r\n}\r\n'.encode())
    found = only(load(path))
    assert str(found.position) == f"{path}:2:13"


def test_an_empty_file_is_an_empty_configuration(tmp_path: Path) -> None:
    path = tmp_path / "empty.pbtxt"
    path.touch()
    loaded = load(path)
    assert loaded.diagnostics == []
    assert loaded.is_readable
    assert loaded.sources == {str(path): ""}
