"""``joshua fmt``: give configuration files one layout."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse

    from joshua.config.format_file import Formatted

_STANDARD_INPUT = "-"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of ``joshua fmt``."""
    parser.add_argument(
        "files", nargs="+", metavar="FILE", help="file to format in place; - filters standard input"
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="change nothing; name the files that would change and exit with 1",
    )


def run(arguments: argparse.Namespace) -> int:
    """Formats the files; 1 where ``--check`` finds one to change, 2 where one cannot be formatted."""
    code = ExitCode.OK
    for path in arguments.files:
        result = _filter(arguments.check) if path == _STANDARD_INPUT else _file(path, arguments.check)
        code = max(code, result)
    return code


def _file(path: str, check: bool) -> ExitCode:
    from joshua.config.format_file import format_file, replace_file

    formatted = format_file(path)
    if formatted.text is None:
        return _refuse(path, formatted)
    if not formatted.is_changed:
        return ExitCode.OK
    if check:
        sys.stdout.write(f"{path}: would be formatted\n")
        return ExitCode.FAILED
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


def _filter(check: bool) -> ExitCode:
    from joshua.config.format_file import format_bytes
    from joshua.textproto.limits import MAX_FILE_BYTES

    formatted = format_bytes("<stdin>", sys.stdin.buffer.read(MAX_FILE_BYTES + 1))
    if formatted.text is None:
        return _refuse("<stdin>", formatted)
    if check:
        if formatted.is_changed:
            sys.stdout.write("<stdin>: would be formatted\n")
        return ExitCode.FAILED if formatted.is_changed else ExitCode.OK
    sys.stdout.buffer.write(formatted.text.encode())
    sys.stdout.buffer.flush()
    return ExitCode.OK


def _refuse(name: str, formatted: Formatted) -> ExitCode:
    from joshua.config.diagnostics import columns_of, render_text, wants_color

    color, columns = wants_color(sys.stderr), columns_of(sys.stderr)
    sys.stderr.write(render_text(formatted.diagnostics, formatted.sources, color, columns))
    sys.stderr.write(f"joshua fmt: {name} is left as it is\n")
    return ExitCode.INVALID
