"""May this user open a device?"""

from __future__ import annotations

import stat
from pathlib import Path

from joshua.cli.doctor.finding import Finding, Level
from joshua.cli.doctor.host import Host

NAME = "permissions"


def may_open(host: Host, path: str) -> Finding:
    """Compares owner, group and mode of a device with the user's session."""
    try:
        status = Path(path).stat()
    except OSError as error:
        return Finding(Level.ERROR, NAME, path, f"cannot be looked at: {error.strerror}", "plug it in again")
    if host.uid == 0 or _allows(status.st_mode, status.st_uid == host.uid, status.st_gid in host.groups):
        return Finding(Level.OK, NAME, path, "may be opened")
    group = host.group_name(status.st_gid)
    found = f"{stat.filemode(status.st_mode)}, group {group}: {host.user} may not open it"
    if not _allows(status.st_mode, False, True):
        return Finding(
            Level.ERROR,
            NAME,
            path,
            found,
            "install the rules that joshua doctor --udev prints, and plug it in again",
        )
    if host.user in host.members(group):
        return Finding(
            Level.ERROR,
            NAME,
            path,
            f"{found} in this session",
            f"{host.user} is in {group} already: log in again",
        )
    return Finding(Level.ERROR, NAME, path, found, f"sudo usermod -aG {group} {host.user}, then log in again")


def _allows(mode: int, is_owner: bool, is_member: bool) -> bool:
    """Whether a mode lets somebody read and write; the first class that fits decides, as in the kernel."""
    if is_owner:
        needed = stat.S_IRUSR | stat.S_IWUSR
    elif is_member:
        needed = stat.S_IRGRP | stat.S_IWGRP
    else:
        needed = stat.S_IROTH | stat.S_IWOTH
    return mode & needed == needed
