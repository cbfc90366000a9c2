"""What plugins add to ``joshua doctor``: entry points of the group ``joshua.doctor``.

The entry point names a light module. Each of these names may stand in it:

- ``CHECKS``: functions that check the machine and open no device: ``check(host)`` yields findings.
- ``DEVICE_CHECKS``: functions that open devices: ``check(host, arguments)``. They do not run with
  ``--no-scan``, nor with a file, whose drivers open its devices.
- ``NODE_CHECKS``: functions that check one actuator of a file: ``check(spec, settings)``.
- ``add_arguments(parser)``: adds options to the command.
- ``begin(arguments, host)``: runs first; the command exits with the code that it returns, None continues.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import metadata
from typing import Any

from joshua.cli.doctor.finding import Finding, Level
from joshua.cli.doctor.host import Host
from joshua.cli.exit_codes import ExitCode
from joshua.plan import NodeSpec, installing

ENTRY_POINT_GROUP = "joshua.doctor"

Check = Callable[[Host], Iterator[Finding]]
DeviceCheck = Callable[[Host, argparse.Namespace], Iterator[Finding]]
NodeCheck = Callable[[NodeSpec, Any], Iterator[Finding]]


@dataclass(frozen=True)
class Part:
    """What one plugin adds.

    Attributes:
        problem: why it cannot be used, as a finding; None if it can.
    """

    checks: tuple[Check, ...] = ()
    device_checks: tuple[DeviceCheck, ...] = ()
    node_checks: tuple[NodeCheck, ...] = ()
    add_arguments: Callable[[argparse.ArgumentParser], None] | None = None
    begin: Callable[[argparse.Namespace, Host], int | None] | None = None
    problem: Finding | None = None


def installed_parts() -> list[Part]:
    """The parts of all installed plugins by name; one that cannot be imported is only a problem."""
    points = {(point.name, point.value): point for point in metadata.entry_points(group=ENTRY_POINT_GROUP)}
    return [_load(points[key]) for key in sorted(points)]


def _load(point: metadata.EntryPoint) -> Part:
    try:
        module = importlib.import_module(point.value)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - code of a third party
        name = point.dist.name if point.dist else point.name
        text = f"its checks cannot be loaded ({type(error).__name__}: {error})"
        remedy = installing.reinstall(name)
        return Part(problem=Finding(Level.ERROR, "software", name, text, remedy, ExitCode.NOT_INSTALLED))
    checks, device_checks, node_checks = (
        tuple(getattr(module, name, ())) for name in ("CHECKS", "DEVICE_CHECKS", "NODE_CHECKS")
    )
    hooks = (getattr(module, name, None) for name in ("add_arguments", "begin"))
    return Part(checks, device_checks, node_checks, *hooks)
