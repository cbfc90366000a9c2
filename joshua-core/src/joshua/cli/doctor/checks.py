"""The checks of every machine: software, real-time priority, shared memory. Plugins add theirs."""

from __future__ import annotations

import os
import platform
import re
import shutil
from collections.abc import Iterator
from importlib import metadata

from joshua.cli.doctor.finding import Finding, Level
from joshua.cli.doctor.host import Host
from joshua.cli.doctor.parts import Check
from joshua.cli.exit_codes import ExitCode
from joshua.plan import installing
from joshua.plugins import PluginStatus, load_registry
from joshua.plugins.hints import stated

SOFTWARE = "software"
# The part of a version number whose change means that core and plugin no longer fit.
SERIES = 2


def check_software(host: Host) -> Iterator[Finding]:
    """Names versions, and what is wrong with a plugin."""
    del host  # the software is that of this process
    try:
        core = metadata.version("joshua-core")
    except metadata.PackageNotFoundError:
        core = "unknown"
    python = platform.python_version()
    yield Finding(
        Level.OK, SOFTWARE, "joshua-core", f"{core} on Python {python}, {platform.platform(terse=True)}"
    )
    ours = stated().distributions()
    for row in load_registry().rows():
        if row.status in (PluginStatus.BROKEN, PluginStatus.CONFLICT):
            yield Finding(
                Level.ERROR,
                SOFTWARE,
                row.distribution,
                "; ".join(row.reasons),
                installing.reinstall(row.distribution)
                if row.status is PluginStatus.BROKEN
                else "joshua plugins says which plugins are in conflict: uninstall one of them",
                ExitCode.NOT_INSTALLED,
            )
        elif row.distribution in ours and _series(row.version) != _series(core):
            yield Finding(
                Level.WARNING,
                SOFTWARE,
                row.distribution,
                f"is {row.version}, made for another core than {core}",
                _upgrade(row.distribution),
            )
        elif row.distribution != "joshua-core":  # the core's own devices and models: it has its row
            yield Finding(Level.OK, SOFTWARE, row.distribution, row.version)


def _upgrade(distribution: str) -> str:
    command = installing.upgrade(distribution)
    return command.replace("--upgrade", f"--upgrade {installing.CORE}", 1)


def _series(version: str) -> list[str]:
    return version.split(".")[:SERIES]


REALTIME = "real-time priority"
LOCKED_MEMORY = "locked memory"
LIMITS_FILE = "/etc/security/limits.d/joshua.conf"


def check_realtime(host: Host) -> Iterator[Finding]:
    """Read the limits that the system grants to the control loops of this session."""
    wanted = (
        (REALTIME, "realtime priority", "rtprio 1", lambda limit: limit != "0", "delays control loops"),
        (LOCKED_MEMORY, "locked memory", "memlock unlimited", "unlimited".__eq__, "may swap drivers out"),
    )
    for check, name, line, is_enough, effect in wanted:
        found = re.search(rf"^Max {name}\s+(\S+)", host.read("proc/self/limits"), re.MULTILINE)
        if found is None:
            continue  # not Linux
        if is_enough(found[1]):
            yield Finding(Level.OK, check, host.user, f"granted up to {found[1]}")
            continue
        yield Finding(
            Level.NOTE,
            check,
            host.user,
            f"not granted ({found[1]}): a busy machine {effect}",
            f'echo "{host.user} - {line}" | sudo tee -a {LIMITS_FILE}, then log in again',
        )


SHARED_MEMORY = "shared memory"
LEAST_MIB = 128
PLACE = "/dev/shm"  # noqa: S108 - it is looked at, and nothing is kept there


def check_shared_memory(host: Host, least_mib: float = LEAST_MIB) -> Iterator[Finding]:
    """Looks at the place, its mode and its free space."""
    folder = host.root / "dev/shm"
    if not (host.root / "proc").is_dir():
        return  # no Linux: shared memory has no folder there
    if not folder.is_dir():
        yield Finding(
            Level.ERROR,
            SHARED_MEMORY,
            PLACE,
            "is not there",
            "mount it: sudo mount -t tmpfs -o size=512m tmpfs /dev/shm",
        )
        return
    if not os.access(folder, os.W_OK):
        yield Finding(Level.ERROR, SHARED_MEMORY, PLACE, "cannot be written", "sudo chmod 1777 /dev/shm")
        return
    free_mib = shutil.disk_usage(folder).free / 2**20
    if free_mib >= least_mib:
        yield Finding(Level.OK, SHARED_MEMORY, PLACE, f"{free_mib:.0f} MiB free")
        return
    yield Finding(
        Level.WARNING,
        SHARED_MEMORY,
        PLACE,
        f"only {free_mib:.0f} MiB are free; pictures of several cameras need {least_mib:.0f} MiB",
        "remove what lies there, or make it larger; in a container: docker run --shm-size=512m",
    )


CHECKS: tuple[Check, ...] = (check_software, check_realtime, check_shared_memory)
