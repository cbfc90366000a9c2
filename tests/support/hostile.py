"""Names and folders that try to lead a program out of the folder that they belong to."""

from __future__ import annotations

import hashlib
import os
import stat
from pathlib import Path

#: Names that a program must not use as a part of a path, by what is wrong with them.
NAMES = {
    "empty": "",
    "dot": ".",
    "parent": "..",
    "parents": "../../victim",
    "many parents": "../../../../../../../../victim",
    "parent in the middle": "top/../../../victim",
    "parent at the end": "top/..",
    "absolute": "/victim",
    "folder": "a/b",
    "backslashes": "..\\..\\victim",
    "drive": "C:victim",
    "stream": "top:victim",
    "NUL": "top\0victim",
    "NUL first": "\0",
    "newline": "top\nvictim",
    "carriage return": "top\rvictim",
    "tab": "top\tvictim",
    "escape": "top\x1b[2Jvictim",
    "8-bit escape": "top\x9b2Jvictim",
    "backspace": "top\b\b\b",
    "delete": "top\x7f",
    "too long": "x" * 5000,
    "longer than a file name": "x" * 252,
    "longer in bytes": "ä" * 130,
    "wide dots and slash": "．．／．．／victim",
    "one dot leaders": "․․/victim",
    "two dot leader": "‥",
    "wide letters": "ｔｏｐ",
    "division slash": "..∕victim",
    "fraction slash": "..⁄victim",
    "ligature": "ﬁle",
    "decomposed": "u\u0308ber",
    "right to left": "top\u202evictim",
    "zero width": "to\u200bp",
    "byte order mark": "\ufefftop",
    "lone surrogate": "top\ud800",
    "private use": "top\ue000",
    "unassigned": "top\U000e0080",
    "line separator": "top\u2028victim",
    "device": "con",
    "device with suffix": "NUL.png",
    "serial port": "com1",
    "leading space": " top",
    "trailing space": "top ",
    "trailing dot": "top.",
    "leading dot": ".joshua",
    "leading dash": "-rf",
    "home": "~/victim",
    "variable": "$HOME/victim",
    "command": "`touch victim`",
    "pipe": "top|victim",
    "glob": "*",
    "question mark": "to?",
    "quotes": "top'victim",
    "double quotes": 'top"victim',
    "markup": "<script>",
    "field": "{chunk_index}",
    "attribute": "{chunk_index.__class__.__mro__}",
    "open field": "{",
    "percent": "%2e%2e%2fvictim",
}

#: Paths below a folder that must be refused, whatever file they name.
TEMPLATES = {
    "parents": "../../victim/file-{file_index:03d}.parquet",
    "parents behind a name": "data/../../../victim/thesis.txt",
    "absolute": "/victim/thesis.txt",
    "devices": "/dev/zero",
    "processes": "/proc/self/environ",
    "attributes": "data/{chunk_index.__class__.__mro__}",
    "items": "data/{chunk_index[0]}",
    "wide": "data/{chunk_index:0999999999d}",
    "conversion": "data/{chunk_index!r}",
    "positional": "data/{}",
    "unknown": "data/{secret}",
    "unclosed": "data/{chunk_index",
    "NUL": "data/\0/file",
    "newline": "data/\n/file",
    "long": "data/" + "x" * 5000,
    "surrogate": "data/\ud800",
}


def fill(folder: Path) -> None:
    """Create a tree with files of the names that a data set has, as bait."""
    for name in (
        *("thesis.txt", "lock", "uploads.json", "episode.json", "rows.arrows", "info.json", "stats.json"),
        *(
            "info.new",
            "stats.new",
            "tasks.new",
            "file-000.new",
            "file-001.new",
            "file-000.mp4",
            "file-001.mp4",
        ),
        *("open/episode.json", "open/rows.arrows", "open/thesis.txt", "chunk-000/file-000.new"),
        *("chunk-000/file-000.parquet", "chunk-000/file-001.mp4", "episodes/chunk-000/file-000.new"),
        *("chunk-000/episode-000/frame-000000.png", "incoming/part", "jobs/000000/thesis.txt"),
    ):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"precious {name}")
    (folder / "empty").mkdir()


def manifest(folder: Path, but: tuple[Path, ...] = ()) -> dict[str, tuple[str, int, int, str]]:
    """Return kind, mode, time of change and content of everything in a folder, but some of its trees."""
    found: dict[str, tuple[str, int, int, str]] = {}
    waiting = [folder]
    while waiting:
        for entry in os.scandir(waiting.pop()):
            path, state = Path(entry.path), entry.stat(follow_symlinks=False)
            if path in but:
                continue
            content = ""
            if entry.is_symlink():
                content = os.readlink(path)
            elif stat.S_ISREG(state.st_mode):
                content = hashlib.sha256(path.read_bytes()).hexdigest()
            elif stat.S_ISDIR(state.st_mode):
                waiting.append(path)
            found[str(path)] = (stat.filemode(state.st_mode), state.st_mode, state.st_mtime_ns, content)
    return found
