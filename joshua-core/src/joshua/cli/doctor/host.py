"""The machine that is looked at: its files below a root, and the user who asks."""

from __future__ import annotations

import grp
import os
import pwd
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path


def _user_name() -> str:
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return str(os.getuid())


@dataclass(frozen=True)
class Host:
    """One machine.

    Attributes:
        root: folder that holds ``dev``, ``sys``, ``proc`` and ``etc``: ``/`` for this machine.
        uid, groups: of the user, as this session has them; user: name.
    """

    root: Path = Path("/")
    uid: int = field(default_factory=os.getuid)
    groups: tuple[int, ...] = field(default_factory=lambda: (os.getgid(), *os.getgroups()))
    user: str = field(default_factory=_user_name)

    def read(self, path: str) -> str:
        """Content of a file below the root without white space at its ends; "" where there is none."""
        try:
            return (self.root / path).read_text(encoding="utf-8", errors="replace").strip()
        except OSError:
            return ""

    def process_names(self) -> Iterator[str]:
        """Names of the processes that run."""
        for file in (self.root / "proc").glob("[0-9]*/comm"):
            try:
                yield file.read_text(encoding="utf-8", errors="replace").strip()
            except OSError:
                continue  # it has just ended

    def group_name(self, number: int) -> str:
        """Name of a group by the machine's own list, else its number."""
        for line in self.read("etc/group").splitlines():
            name, _, rest = line.partition(":")
            if rest.split(":")[1:2] == [str(number)]:
                return name
        try:
            return grp.getgrgid(number).gr_name
        except KeyError:
            return str(number)

    def members(self, group: str) -> tuple[str, ...]:
        """Members of a group by the machine's list, which a session takes over at its next log-in."""
        for line in self.read("etc/group").splitlines():
            parts = line.split(":")
            if parts[0] == group and len(parts) > 3:
                return tuple(name for name in parts[3].split(",") if name)
        return ()

    def udev_rules(self) -> str:
        """All udev rules of the machine."""
        folders = ("etc/udev/rules.d", "run/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d")
        files = [file for folder in folders for file in sorted((self.root / folder).glob("*.rules"))]
        return "\n".join(self.read(str(file.relative_to(self.root))) for file in files)
