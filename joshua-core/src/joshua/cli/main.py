"""The entry point of ``joshua``: parse, choose the command, run it, return its exit code."""

from __future__ import annotations

import contextlib
import errno
import gc
import io
import os
import sys
from typing import TYPE_CHECKING, TextIO, cast

from joshua.cli.exit_codes import ExitCode
from joshua.plan.foreign_text import SafeStream

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Sequence

NO_FAULTS = "--fault has no effect with --validate-only, which starts no emulator: leave one of them out"


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code."""
    try:
        # Imported here, so that Ctrl-C during the import exits cleanly.
        from joshua.cli.parser import parse
        from joshua.plan.lazy import without_pydantic_plugins

        without_pydantic_plugins()
        parser, arguments = parse(argv)
        if arguments.version:
            return print_version()
        if arguments.print_completion:
            return print_completion(arguments.print_completion)
        if arguments.command:
            return int(arguments.run(arguments))
        if arguments.config is not None:
            return run_configuration(arguments)
        if parser.arguments:
            parser.error("no file given: add --config PATH, or a command")
        parser.print_help()
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED
    except BrokenPipeError:
        # The reader of a pipe has closed it, so the rest cannot be written.
        sys.stderr.close()
        return ExitCode.OK
    except OSError as error:
        if error.errno != errno.ENOSPC or error.filename is not None:
            raise
        return _unwritten(error)
    return ExitCode.INVALID


def print_version() -> int:
    """Print the version of the core."""
    from importlib.metadata import version

    sys.stdout.write(f"joshua {version('joshua-core')}\n")
    return ExitCode.OK


def print_completion(shell: str) -> int:
    """Print the completion script of a shell, which completes words without starting Python."""
    import shtab

    from joshua.cli.parser import build_parser
    from joshua.cli.presets import preset_names
    from joshua.cli.table import usable_commands

    parser = build_parser(populate=True, further=usable_commands())
    for action in actions(parser):
        if action.metavar in ("PATH", "FILE"):
            action.complete = shtab.FILE  # type: ignore[attr-defined]
        elif action.metavar == "PRESET":
            action.choices = preset_names()
    sys.stdout.write(str(shtab.complete(parser, shell=shell)))
    return ExitCode.OK


def actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield every option and argument of a parser and of its subcommands."""
    for action in parser._actions:
        yield action
        if isinstance(action.choices, dict):
            for sub in dict.fromkeys(action.choices.values()):
                yield from actions(sub)


def run_configuration(arguments: argparse.Namespace) -> int:
    """Check a configuration, and run it unless only the check was requested."""
    if arguments.validate_only:
        return validate(arguments)
    from joshua.cli.run import run

    return run(arguments)


def validate(arguments: argparse.Namespace) -> int:
    """Check a file and report every problem; exit code 0 or 2."""
    from joshua.cli.options import FAULT_ALONE
    from joshua.cli.report import exit_code_of, request_of, show_findings
    from joshua.planner.pipeline import examine
    from joshua.planner.request import Purpose

    if arguments.faults:
        sys.stderr.write(f"joshua: error: {NO_FAULTS if arguments.emulate else FAULT_ALONE}\n")
        return ExitCode.INVALID
    result = examine(request_of(arguments, Purpose.VALIDATE))
    show_findings(result, arguments.format)
    if exit_code_of(result) is not ExitCode.OK:
        return ExitCode.INVALID
    if arguments.format == "text":
        sys.stdout.write(f"{arguments.config}: valid\n")
    return ExitCode.OK


def program() -> None:
    """Run the command line and exit the process.

    A check neither collects garbage nor frees its memory at the end, which would take a fifth of its time.
    """
    _ready_streams()
    only_checks = "--validate-only" in sys.argv
    if only_checks:
        gc.disable()
    code = main()
    if only_checks:
        os._exit(_flushed(code))
    sys.exit(code)


def _ready_streams() -> None:
    """Open standard streams that the shell has closed, and escape what a terminal cannot show.

    Otherwise a socket could get the number of a stream that native code writes to. A path may hold bytes that
    are not text.
    """
    for descriptor, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # takes the lowest free number: this one
        if getattr(sys, name) is None:
            setattr(sys, name, open(descriptor, mode, closefd=False))  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    sys.stdout, sys.stderr = (cast("TextIO", SafeStream(stream)) for stream in (sys.stdout, sys.stderr))


def _flushed(code: int) -> int:
    """Flush the output. Returns the exit code, or another one if that fails."""
    try:
        sys.stdout.flush()
    except (BrokenPipeError, ValueError):
        pass  # the reader of a pipe has closed it
    except OSError as error:
        return _unwritten(error)
    return code


def _unwritten(error: OSError) -> int:
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.write(f"joshua: the output cannot be written: {error.strerror}\n")
        sys.stderr.flush()
    return ExitCode.FAILED


if __name__ == "__main__":
    program()
