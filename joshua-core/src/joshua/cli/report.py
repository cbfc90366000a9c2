"""How commands show findings: text for people, JSON for editors, and the exit code that follows."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse

    from joshua.planner.pipeline import Examination
    from joshua.planner.request import Purpose, Request


def request_of(arguments: argparse.Namespace, purpose: Purpose) -> Request:
    """Turns the options of a command line into the request that ``examine`` takes."""
    from joshua.planner.request import Request

    return Request(
        path=arguments.config,
        overrides=tuple(arguments.overrides),
        purpose=purpose,
        host=arguments.host or "",
        blocked_plugins=tuple(arguments.blocked_plugins),
        duration_s=getattr(arguments, "duration", None),
        allow_uncalibrated=getattr(arguments, "allow_uncalibrated", False),
        dry_run=getattr(arguments, "dry_run", False),
        emulate=getattr(arguments, "emulate", False),
        simulate=getattr(arguments, "sim", False),
    )


def show_findings(examination: Examination, output_format: str) -> None:
    """Prints all findings: JSON to standard output, text to standard error."""
    from joshua.config.diagnostics import columns_of, render_json, render_text, wants_color

    if output_format == "json":
        sys.stdout.write(render_json(examination.diagnostics) + "\n")
    elif examination.diagnostics:
        color, columns = wants_color(sys.stderr), columns_of(sys.stderr)
        sys.stderr.write(render_text(examination.diagnostics, examination.sources, color, columns))


def exit_code_of(examination: Examination) -> ExitCode:
    """Names the exit code of an examination: a missing plugin counts only when nothing else is wrong."""
    if not examination.errors:
        return ExitCode.OK
    if all(item.code in ("plugin-missing", "extra-missing") for item in examination.errors):
        return ExitCode.NOT_INSTALLED
    return ExitCode.INVALID
