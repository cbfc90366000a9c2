"""The bus tools of the installed plugins."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from joshua.api import ActuatorSpec
from joshua.tools import TargetError, load_registry, load_target

if TYPE_CHECKING:
    from joshua.tools import Registry


def installed_bus_tools(registry: Registry | None = None) -> dict[str, type[Any]]:
    """Return the bus tools by configuration block, such as ``sts3215_config``.

    Tools that cannot be imported are reported on standard error and left out.
    """
    found: dict[str, type[Any]] = {}
    for row in (registry or load_registry()).rows():
        for spec in row.specs:
            if not isinstance(spec, ActuatorSpec) or not spec.bus_tools or spec.block in found:
                continue
            try:
                found[spec.block] = load_target(spec.bus_tools)
            except TargetError as error:
                sys.stderr.write(f"{row.distribution}: {error}\n")
    return found


def short_name(block: str) -> str:
    """Return the name of a family on the command line: ``sts3215`` for ``sts3215_config``."""
    return block.removesuffix("_config").rpartition(".")[2]
