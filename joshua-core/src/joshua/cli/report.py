"""How commands show findings: text for people, JSON for editors, and the exit code that follows."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse

    from joshua.planner.pipeline import PipelineResult
    from joshua.planner.request import Purpose, Request


#: Errors that an installation cures.
_INSTALLABLE = ("plugin-missing", "extra-missing", "emulator-missing")


def state_home_of(*, emulate: bool = False, simulate: bool = False) -> str:
    """The folder of what stand-ins of devices keep; "" where there are none."""
    if not (emulate or simulate):
        return ""
    from joshua.ipc.run_bases import state_home

    return str(state_home(os.environ))


def request_of(arguments: argparse.Namespace, purpose: Purpose) -> Request:
    """Turns the options of a command line into the request that ``examine`` takes."""
    from joshua.planner.request import Request

    emulate, simulate = getattr(arguments, "emulate", False), getattr(arguments, "sim", False)
    return Request(
        path=arguments.config,
        overrides=tuple(arguments.overrides),
        purpose=purpose,
        host=arguments.host or "",
        blocked_plugins=tuple(arguments.blocked_plugins),
        duration_s=getattr(arguments, "duration", None),
        allow_uncalibrated=getattr(arguments, "allow_uncalibrated", False),
        dry_run=getattr(arguments, "dry_run", False),
        emulate=emulate,
        simulate=simulate,
        state_home=state_home_of(emulate=emulate, simulate=simulate),
    )


def show_findings(result: PipelineResult, output_format: str) -> None:
    """Prints all findings: JSON to standard output, text to standard error."""
    from joshua.config.diagnostics import columns_of, render_json, render_text, wants_color

    if output_format == "json":
        sys.stdout.write(render_json(result.diagnostics) + "\n")
    elif result.diagnostics:
        color, columns = wants_color(sys.stderr), columns_of(sys.stderr)
        sys.stderr.write(render_text(result.diagnostics, result.sources, color, columns))


def exit_code_of(result: PipelineResult) -> ExitCode:
    """Names the exit code of a result: a missing plugin counts only when nothing else is wrong."""
    if not result.errors:
        return ExitCode.OK
    if all(item.code in ("plugin-missing", "extra-missing", "emulator-missing") for item in result.errors):
        return ExitCode.NOT_INSTALLED
    return ExitCode.INVALID
