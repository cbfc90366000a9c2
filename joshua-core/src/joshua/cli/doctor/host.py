"""The machine that the doctor checks: its files, its user, and the user's permissions."""

from __future__ import annotations

import grp
import os
import pwd
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from joshua.cli.doctor.result import DoctorResult, Level


def _user_name() -> str:
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return str(os.getuid())


@dataclass(frozen=True)
class Host:
    """One machine.

    Attributes:
        root: folder with ``dev``, ``sys``, ``proc`` and ``etc``: ``/`` for this machine.
        uid, groups: of the user in this session; user: name.
    """

    root: Path = Path("/")
    uid: int = field(default_factory=os.getuid)
    groups: tuple[int, ...] = field(default_factory=lambda: (os.getgid(), *os.getgroups()))
    user: str = field(default_factory=_user_name)

    def read(self, path: str) -> str:
        """Read a file below the root, without white space at its ends; "" if there is none."""
        try:
            return (self.root / path).read_text(encoding="utf-8", errors="replace").strip()
        except OSError:
            return ""

    def process_names(self) -> Iterator[str]:
        """Names of the running processes."""
        for file in (self.root / "proc").glob("[0-9]*/comm"):
            try:
                yield file.read_text(encoding="utf-8", errors="replace").strip()
            except OSError:
                continue  # it has just ended

    def group_name(self, number: int) -> str:
        """Name of a group in the machine's list, else its number."""
        for line in self.read("etc/group").splitlines():
            name, _, rest = line.partition(":")
            if rest.split(":")[1:2] == [str(number)]:
                return name
        try:
            return grp.getgrgid(number).gr_name
        except KeyError:
            return str(number)

    def members(self, group: str) -> tuple[str, ...]:
        """Members of a group in the machine's list, which takes effect at the next log-in."""
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


def may_open(host: Host, path: str) -> DoctorResult:
    """Compare owner, group and mode of a device with the user's session."""

    def error(message: str, remedy: str) -> DoctorResult:
        return DoctorResult(Level.ERROR, "permissions", path, message, remedy)

    try:
        status = Path(path).stat()
    except OSError as problem:
        return error(f"cannot be checked: {problem.strerror}", "plug it in again")
    if host.uid == 0 or _allows(status.st_mode, status.st_uid == host.uid, status.st_gid in host.groups):
        return DoctorResult(Level.OK, "permissions", path, "can be opened")
    group = host.group_name(status.st_gid)
    found = f"{stat.filemode(status.st_mode)}, group {group}: {host.user} may not open it"
    if not _allows(status.st_mode, False, True):
        return error(found, "install the rules of `joshua doctor --udev`, then plug it in again")
    if host.user in host.members(group):
        return error(f"{found} in this session", f"log in again: {host.user} is already in {group}")
    return error(found, f"run `sudo usermod -aG {group} {host.user}`, then log in again")


def _allows(mode: int, is_owner: bool, is_member: bool) -> bool:
    """Whether a mode allows reading and writing. The first matching class decides, as in the kernel."""
    shift = 6 if is_owner else 3 if is_member else 0
    return mode >> shift & 0o6 == 0o6
