"""``joshua --config PATH --validate-only``: check a file and start nothing."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.cli.report import exit_code_of, request_of, show_findings

if TYPE_CHECKING:
    import argparse


def validate(arguments: argparse.Namespace) -> int:
    """Checks the file and reports every problem; exit code 0 or 2."""
    from joshua.generator.examination import examine
    from joshua.generator.request import Purpose

    examination = examine(request_of(arguments, Purpose.VALIDATE))
    show_findings(examination, arguments.format)
    code = exit_code_of(examination)
    if code is ExitCode.OK and arguments.format == "text":
        sys.stdout.write(f"{arguments.config}: valid\n")
    return ExitCode.OK if code is ExitCode.OK else ExitCode.INVALID
