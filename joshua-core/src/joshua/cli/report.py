"""Reading a request from options, showing findings, and choosing the exit code."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.plan.foreign_text import raw

if TYPE_CHECKING:
    import argparse

    from joshua.planner.pipeline import PipelineResult
    from joshua.planner.request import Purpose, Request


#: Errors that installing something solves.
_INSTALLABLE = ("plugin-missing", "extra-missing", "emulator-missing")


def state_home_of(*, emulate: bool = False, simulate: bool = False) -> str:
    """Return the folder for the state of emulated and simulated devices; "" without them."""
    if not (emulate or simulate):
        return ""
    from joshua.ipc.run_bases import state_home

    return str(state_home(os.environ))


def request_of(arguments: argparse.Namespace, purpose: Purpose) -> Request:
    """Convert the options of a command line to the request for ``examine``."""
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
    """Print all findings: JSON to standard output, text to standard error."""
    from joshua.config.diagnostics import columns_of, render_json, render_text, wants_color

    if output_format == "json":
        sys.stdout.write(render_json(result.diagnostics) + "\n")
    elif result.diagnostics:
        color, columns = wants_color(sys.stderr), columns_of(sys.stderr)
        raw(sys.stderr).write(render_text(result.diagnostics, result.sources, color, columns))


class NotStartedError(Exception):
    """Nothing is started. The message says why, "" if the findings show it.

    Attributes:
        code: exit code.
    """

    def __init__(self, message: str, code: ExitCode = ExitCode.INVALID) -> None:
        super().__init__(message)
        self.code = code

    @classmethod
    def of(cls, result: PipelineResult, output_format: str) -> NotStartedError:
        """Show the findings of a file that cannot start."""
        show_findings(result, output_format)
        return cls("", exit_code_of(result))

    def show(self) -> ExitCode:
        """Print the reason on standard error. Returns the exit code."""
        problem = f"joshua: error: {self}\n" if str(self) else ""
        sys.stderr.write(f"{problem}nothing was started\n")
        return self.code


def exit_code_of(result: PipelineResult) -> ExitCode:
    """Return the exit code of a result: the machine counts only if the file has no error."""
    codes = {item.code for item in result.errors}
    if not codes:
        return ExitCode.OK
    if codes.issubset(_INSTALLABLE):
        return ExitCode.NOT_INSTALLED
    return ExitCode.HARDWARE if codes.issubset((*_INSTALLABLE, "machine-unfit")) else ExitCode.INVALID


def file_missing(command: str) -> ExitCode:
    """Report that a command needs a file."""
    sys.stderr.write(f"joshua {command}: no file given: joshua {command} FILE\n")
    return ExitCode.INVALID
