"""``joshua fmt``: format configuration files."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse

_STANDARD_INPUT = "-"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua fmt``."""
    parser.add_argument(
        "files", nargs="+", metavar="FILE", help="file to format in place; - filters standard input"
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="change nothing; name the files that would change and exit with 1",
    )


def run(arguments: argparse.Namespace) -> int:
    """Format the files; 1 if ``--check`` finds one to change, 2 if one cannot be formatted."""
    return max(_format(path, arguments.check) for path in arguments.files)


def _format(path: str, check: bool) -> ExitCode:
    from joshua.config.diagnostics import columns_of, render_text, wants_color
    from joshua.config.format_file import format_bytes, format_file, replace_file
    from joshua.textproto.limits import MAX_FILE_BYTES

    filters = path == _STANDARD_INPUT
    name = "<stdin>" if filters else path
    formatted = (
        format_bytes(name, sys.stdin.buffer.read(MAX_FILE_BYTES + 1)) if filters else format_file(path)
    )
    if formatted.text is None:
        color, columns = wants_color(sys.stderr), columns_of(sys.stderr)
        sys.stderr.write(render_text(formatted.diagnostics, formatted.sources, color, columns))
        sys.stderr.write(f"joshua fmt: {name} stays unchanged\n")
        return ExitCode.INVALID
    if check:
        sys.stdout.write(f"{name}: would be formatted\n" * formatted.is_changed)
        return ExitCode.FAILED if formatted.is_changed else ExitCode.OK
    if filters:
        sys.stdout.buffer.write(formatted.text.encode())
        sys.stdout.buffer.flush()
    elif formatted.is_changed:
        try:
            replace_file(path, formatted.text)
        except OSError as fault:
            sys.stderr.write(
                f"joshua fmt: {path} cannot be written: {fault.strerror}\n"
                "  do:      check the permissions of the file and its folder, and the space on the disk\n"
            )
            return ExitCode.INVALID
        sys.stdout.write(f"{path}: formatted\n")
    return ExitCode.OK
