"""The checks of every machine, and those that plugins add: entry points of the group ``joshua.doctor``.

The entry point names a light module with any of these names:

- ``CHECKS``: functions that check the machine and open no device: ``check(host)`` yields results.
- ``DEVICE_CHECKS``: functions that open devices: ``check(host, arguments)``. They do not run with
  ``--no-scan``, nor with a file, whose drivers open its devices.
- ``PLAN_CHECKS``: functions that check the nodes of a file and open no device: ``check(host, plan)``.
- ``NODE_CHECKS``: functions that check one actuator of a file: ``check(spec, settings)``.
- ``add_arguments(parser)``: add options to the command.
- ``begin(arguments, host)``: runs first. The command exits with the returned code; None continues.
"""

from __future__ import annotations

import importlib
import os
import platform
import re
import shutil
from collections.abc import Callable, Iterable, Iterator
from importlib import metadata
from types import SimpleNamespace
from typing import Any

from joshua.cli.doctor.host import Host
from joshua.cli.doctor.result import DoctorResult, Level
from joshua.cli.exit_codes import ExitCode
from joshua.plan import installing
from joshua.plugins import PluginStatus, load_registry
from joshua.plugins.hints import stated

ENTRY_POINT_GROUP = "joshua.doctor"
Check = Callable[[Host], Iterable[DoctorResult]]

SOFTWARE = "software"
# The part of the version number that core and plugin must share.
SERIES = 2


def check_software(host: Host) -> Iterator[DoctorResult]:
    """Name versions, and the problems of plugins."""
    del host  # describes the software of this process
    try:
        core = metadata.version("joshua-core")
    except metadata.PackageNotFoundError:
        core = "unknown"
    versions = f"{core} on Python {platform.python_version()}, {platform.platform(terse=True)}"
    yield DoctorResult(Level.OK, SOFTWARE, "joshua-core", versions)
    ours = stated().distributions()
    for row in load_registry().rows():
        if row.status in (PluginStatus.BROKEN, PluginStatus.CONFLICT):
            remedy = (
                f"run `{installing.reinstall(row.distribution)}`"
                if row.status is PluginStatus.BROKEN
                else "uninstall one of the plugins in conflict: `joshua plugins` lists them"
            )
            reasons, code = "; ".join(row.reasons), ExitCode.NOT_INSTALLED
            yield DoctorResult(Level.ERROR, SOFTWARE, row.distribution, reasons, remedy, code)
        elif row.distribution in ours and _series(row.version) != _series(core):
            text = f"is {row.version}, which does not fit the core {core}"
            yield DoctorResult(Level.WARNING, SOFTWARE, row.distribution, text, _upgrade(row.distribution))
        elif row.distribution != "joshua-core":  # which has its own row
            yield DoctorResult(Level.OK, SOFTWARE, row.distribution, row.version)


def _upgrade(distribution: str) -> str:
    command = installing.upgrade(distribution)
    return f"run `{command.replace('--upgrade', f'--upgrade {installing.CORE}', 1)}`"


def _series(version: str) -> list[str]:
    return version.split(".")[:SERIES]


REALTIME = "real-time priority"
LOCKED_MEMORY = "locked memory"
LIMITS_FILE = "/etc/security/limits.d/joshua.conf"


def check_realtime(host: Host) -> Iterator[DoctorResult]:
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
            yield DoctorResult(Level.OK, check, host.user, f"granted up to {found[1]}")
            continue
        yield DoctorResult(
            Level.NOTE,
            check,
            host.user,
            f"not granted ({found[1]}): a busy machine {effect}",
            f'run `echo "{host.user} - {line}" | sudo tee -a {LIMITS_FILE}`, then log in again',
        )


SHARED_MEMORY = "shared memory"
LEAST_MIB = 128
PLACE = "/dev/shm"  # noqa: S108 - it is checked, and nothing is written there


def check_shared_memory(host: Host, least_mib: float = LEAST_MIB) -> Iterator[DoctorResult]:
    """Check the folder, its mode and its free space."""
    folder = host.root / "dev/shm"
    if not (host.root / "proc").is_dir():
        return  # not Linux: shared memory has no folder there
    if not folder.is_dir():
        found = (Level.ERROR, "does not exist", "run `sudo mount -t tmpfs -o size=512m tmpfs /dev/shm`")
    elif not os.access(folder, os.W_OK):
        found = (Level.ERROR, "is not writable", "run `sudo chmod 1777 /dev/shm`")
    elif (free_mib := shutil.disk_usage(folder).free / 2**20) >= least_mib:
        found = (Level.OK, f"{free_mib:.0f} MiB free", "")
    else:
        found = (
            Level.WARNING,
            f"only {free_mib:.0f} MiB are free; images of several cameras need {least_mib:.0f} MiB",
            "remove files there, or enlarge it; in a container: `docker run --shm-size=512m`",
        )
    level, message, remedy = found
    yield DoctorResult(level, SHARED_MEMORY, PLACE, message, remedy)


CHECKS: tuple[Check, ...] = (check_software, check_realtime, check_shared_memory)


def installed_parts() -> list[Any]:
    """The modules of installed plugins by name. A check replaces a broken one and reports it."""
    points = {(point.name, point.value): point for point in metadata.entry_points(group=ENTRY_POINT_GROUP)}
    return [_load(points[key]) for key in sorted(points)]


def _load(point: metadata.EntryPoint) -> Any:
    try:
        return importlib.import_module(point.value)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - code of a third party
        name = point.dist.name if point.dist else point.name
        text = f"its checks cannot be loaded ({type(error).__name__}: {error})"
        remedy = f"run `{installing.reinstall(name)}`"
        problem = DoctorResult(Level.ERROR, SOFTWARE, name, text, remedy, ExitCode.NOT_INSTALLED)
        return SimpleNamespace(CHECKS=(lambda _host: [problem],))
