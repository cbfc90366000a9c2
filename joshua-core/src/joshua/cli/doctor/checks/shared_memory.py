"""Is there room in shared memory, through which pictures travel between processes?"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator

from joshua.cli.doctor.finding import Finding, Level
from joshua.cli.doctor.host import Host

NAME = "shared memory"
LEAST_MIB = 128
PLACE = "/dev/shm"  # noqa: S108 - it is looked at, and nothing is kept there


def check(host: Host, least_mib: float = LEAST_MIB) -> Iterator[Finding]:
    """Looks at the place, its mode and its free space."""
    folder = host.root / "dev/shm"
    if not (host.root / "proc").is_dir():
        return  # no Linux: shared memory has no folder there
    if not folder.is_dir():
        yield Finding(
            Level.ERROR,
            NAME,
            PLACE,
            "is not there",
            "mount it: sudo mount -t tmpfs -o size=512m tmpfs /dev/shm",
        )
        return
    if not os.access(folder, os.W_OK):
        yield Finding(Level.ERROR, NAME, PLACE, "cannot be written", "sudo chmod 1777 /dev/shm")
        return
    free_mib = shutil.disk_usage(folder).free / 2**20
    if free_mib >= least_mib:
        yield Finding(Level.OK, NAME, PLACE, f"{free_mib:.0f} MiB free")
        return
    yield Finding(
        Level.WARNING,
        NAME,
        PLACE,
        f"only {free_mib:.0f} MiB are free; pictures of several cameras need {least_mib:.0f} MiB",
        "remove what lies there, or make it larger; in a container: docker run --shm-size=512m",
    )
