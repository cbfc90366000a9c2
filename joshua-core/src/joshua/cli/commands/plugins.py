"""``joshua plugins``: the installed plugins, what each provides, and the problems of each."""

from __future__ import annotations

import argparse
import json
import sys
from typing import TYPE_CHECKING, Any

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import add_format

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from joshua.plugins import PluginRow, PluginSpec

_TEXTS = ("kind", "block", "summary", "implementation", "native")

NOTHING = (
    "joshua plugins: no plugin is installed, not even joshua-core: its files are here without its metadata\n"
    "  do: {}\n"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua plugins``."""
    parser.add_argument(
        "--block-plugin",
        dest="blocked_plugins",
        metavar="NAME",
        action="append",
        default=argparse.SUPPRESS,
        help="ignore a plugin, named as in the first column",
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="also import what each plugin names, and check it",
    )
    add_format(parser)
    parser.add_argument(
        "--json",
        dest="format",
        action="store_const",
        const="json",
        default=argparse.SUPPRESS,
        help="the same as --format json",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the list; with ``--check`` the exit code is 1 if a plugin has a problem."""
    from joshua.plan import installing
    from joshua.plugins import PluginStatus, load_registry

    blocked = tuple(getattr(arguments, "blocked_plugins", ()))
    registry = load_registry(blocked=blocked)
    rows = registry.rows()
    if not rows:
        sys.stderr.write(NOTHING.format(installing.install(installing.CORE)))
        return ExitCode.NOT_INSTALLED
    for name in blocked:
        if not registry.knows(name):
            sys.stderr.write(f"joshua plugins: --block-plugin: no plugin {name!r} is installed\n")
    rows += libraries(rows)
    if arguments.check:
        rows = tuple(map(checked, rows))
    if getattr(arguments, "format", "text") == "json":
        from joshua.cli.table import commands_by_distribution

        commands = commands_by_distribution()
        found = [as_json(row) | {"commands": commands.pop(row.distribution, [])} for row in rows]
        sys.stdout.write(json.dumps(found, indent=2) + "\n")
    else:
        sys.stdout.write(listing(rows))
    wrong = [row.distribution for row in rows if row.status in (PluginStatus.BROKEN, PluginStatus.CONFLICT)]
    if arguments.check and getattr(arguments, "format", "text") == "text":
        verdict = f"problems in {', '.join(wrong)}" if wrong else "no problem found"
        sys.stdout.write(f"{len(rows)} plugins checked: {verdict}\n")
    return ExitCode.FAILED if arguments.check and wrong else ExitCode.OK


def libraries(rows: Sequence[PluginRow]) -> tuple[PluginRow, ...]:
    """Distributions that provide only commands."""
    from importlib import metadata

    from joshua.cli.table import commands_by_distribution
    from joshua.plugins import PluginRow

    others = commands_by_distribution().keys() - {row.distribution for row in rows} - {"(unknown)"}
    return tuple(PluginRow(name, name, metadata.version(name)) for name in sorted(others))


def checked(row: PluginRow) -> PluginRow:
    """The same plugin, with all import strings loaded and checked, including commands."""
    from dataclasses import replace

    from joshua.cli.table import PluginCommandError, load_command, plugin_commands
    from joshua.plugins import PluginStatus
    from joshua.plugins.targets import check_targets

    problems = [f"{subject(spec)}: {problem}" for spec in row.specs for problem in check_targets(spec)]
    for command in plugin_commands():
        if command.distribution == row.distribution and row.status is not PluginStatus.BLOCKED:
            try:
                load_command(command)
            except PluginCommandError as error:
                problems.append(str(error))
    if not problems:
        return row
    return replace(row, status=PluginStatus.BROKEN, reasons=(*row.reasons, *problems))


def subject(spec: PluginSpec) -> str:
    """The value or block of a spec in a configuration file."""
    return getattr(spec, "name", "") or spec.block or ", ".join(spec.enum_values)


def listing(rows: Sequence[PluginRow]) -> str:
    """Lay out plugins: one block of lines each, problems first."""
    from joshua.cli.table import commands_by_distribution
    from joshua.supervisor.tables import Screen, columns

    commands = commands_by_distribution()
    cells = [("NAME", "VERSION", "STATUS", "PROVIDES")]
    for row in rows:
        details = [*(f"! {reason}" for reason in row.reasons), *_spec_lines(row.specs)]
        details += [f"command joshua {name}" for name in commands.pop(row.distribution, ())]
        cells.append((row.distribution, row.version, row.status.value, details[0] if details else "nothing"))
        cells += [("", "", "", detail) for detail in details[1:]]
    return "\n".join(columns(cells, screen=Screen.of(sys.stdout), drop=(1,), flexible=3)) + "\n"


def _spec_lines(specs: Iterable[PluginSpec]) -> list[str]:
    lines = []
    for spec in specs:
        summary = f": {spec.summary}" if spec.summary else ""
        lines.append(f"{spec.kind} {subject(spec)}{summary}")
        if spec.block and spec.enum_values:
            lines.append(f"  for {', '.join(spec.enum_values)}")
    return lines


def as_json(row: PluginRow) -> dict[str, Any]:
    """One plugin for programs."""
    return {
        "name": row.distribution,
        "entry_point": row.name,
        "module": row.module,
        "version": row.version,
        "status": row.status.value,
        "reasons": list(row.reasons),
        "provides": [
            {
                name: getattr(spec, name, "")
                for name in ("kind", "block", "summary", "implementation", "native")
            }
            | {name: list(getattr(spec, name, ())) for name in ("enum_values", "data_types")}
            for spec in row.specs
        ],
    }
