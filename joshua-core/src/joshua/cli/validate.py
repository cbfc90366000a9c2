"""``joshua --config PATH --validate-only``: check a file and start nothing."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import FAULT_ALONE
from joshua.cli.report import exit_code_of, request_of, show_findings

if TYPE_CHECKING:
    import argparse

NO_FAULTS = "--fault has no effect with --validate-only, which starts no emulator: leave one of them out"


def validate(arguments: argparse.Namespace) -> int:
    """Checks the file and reports every problem; exit code 0 or 2."""
    if arguments.faults:
        sys.stderr.write(f"joshua: error: {NO_FAULTS if arguments.emulate else FAULT_ALONE}\n")
        return ExitCode.INVALID
    from joshua.planner.pipeline import examine
    from joshua.planner.request import Purpose

    _skip_pydantic_plugins()
    result = examine(request_of(arguments, Purpose.VALIDATE))
    show_findings(result, arguments.format)
    code = exit_code_of(result)
    if code is ExitCode.OK and arguments.format == "text":
        sys.stdout.write(f"{arguments.config}: valid\n")
    return ExitCode.OK if code is ExitCode.OK else ExitCode.INVALID


def _skip_pydantic_plugins() -> None:
    """Keeps pydantic from reading the metadata of every installed package in search of plugins for itself.

    That is a twelfth of the time of a check, which no plugin of pydantic could make worth it.
    """
    name = "pydantic.plugin._loader"
    if name not in sys.modules:
        stand_in: Any = ModuleType(name)
        stand_in.get_plugins = tuple
        sys.modules[name] = stand_in
