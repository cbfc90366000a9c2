"""Which processes hold a device, as a folder of processes shows them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from joshua_serial.port_holders import describe_process, holders


def process(proc: Path, number: int, name: str, *words: str, opens: Path | None = None) -> None:
    folder = proc / str(number)
    (folder / "fd").mkdir(parents=True)
    (folder / "comm").write_text(name + "\n")
    (folder / "cmdline").write_bytes(b"".join(word.encode() + b"\0" for word in words))
    if opens is not None:
        (folder / "fd" / "3").symlink_to(opens)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("minicom", "-D", "/dev/ttyACM0"), "arm (process 7)"),
        (
            ("python3", "/bin/joshua", "--config", "a.pbtxt"),
            "arm (process 7) of a run that `joshua stop` ends",
        ),
        (
            ("python3", "-m", "joshua.cli.main", "--config", "a"),
            "arm (process 7) of a run that `joshua stop` ends",
        ),
        (("python3", "/bin/joshua", "find-port"), "arm (process 7)"),
        (("joshua",), "arm (process 7)"),
    ],
)
def test_a_process_is_named_with_how_to_end_it(tmp_path: Path, words: tuple[str, ...], text: str) -> None:
    process(tmp_path, 7, "arm", *words)
    assert describe_process(7, tmp_path) == text
    assert describe_process(8, tmp_path) == "process 8"


def test_this_process_is_told_from_others() -> None:
    assert describe_process(os.getpid()).endswith(f"(process {os.getpid()}, this one)")


def test_who_has_locked_a_device_goes_before_who_has_it_open(tmp_path: Path) -> None:
    device = tmp_path / "ttyACM0"
    device.touch()
    proc = tmp_path / "proc"
    process(proc, 11, "one", "one", opens=device)
    process(proc, 12, "two", "two", opens=device)
    assert sorted(holders(str(device), proc)) == [11, 12]
    status = device.stat()
    number = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}:{status.st_ino}"
    (proc / "locks").write_text(f"1: FLOCK  ADVISORY  WRITE 12 {number} 0 EOF\n")
    assert holders(str(device), proc) == [12]
