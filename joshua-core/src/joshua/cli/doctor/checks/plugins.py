"""Is the software in order: Python, the core, and each plugin?"""

from __future__ import annotations

import platform
from collections.abc import Iterator
from importlib import metadata

from joshua.cli.doctor.finding import Finding, Level
from joshua.cli.doctor.host import Host
from joshua.cli.exit_codes import ExitCode
from joshua.plan import installing
from joshua.plugins import PluginStatus, load_registry
from joshua.plugins.hints import stated

NAME = "software"
# The part of a version number whose change means that core and plugin no longer fit.
SERIES = 2


def check(host: Host) -> Iterator[Finding]:
    """Names versions, and what is wrong with a plugin."""
    del host  # the software is that of this process
    try:
        core = metadata.version("joshua-core")
    except metadata.PackageNotFoundError:
        core = "unknown"
    python = platform.python_version()
    yield Finding(
        Level.OK, NAME, "joshua-core", f"{core} on Python {python}, {platform.platform(terse=True)}"
    )
    ours = stated().distributions()
    for row in load_registry().rows():
        if row.status in (PluginStatus.BROKEN, PluginStatus.CONFLICT):
            yield Finding(
                Level.ERROR,
                NAME,
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
                NAME,
                row.distribution,
                f"is {row.version}, made for another core than {core}",
                _upgrade(row.distribution),
            )
        elif row.distribution != "joshua-core":  # the core's own devices and models: it has its row
            yield Finding(Level.OK, NAME, row.distribution, row.version)


def _upgrade(distribution: str) -> str:
    if installing.target(distribution) != distribution:
        return installing.upgrade(distribution)
    return f"pip install --upgrade {installing.CORE} {distribution}"


def _series(version: str) -> list[str]:
    return version.split(".")[:SERIES]
