"""The entry point of ``joshua``: parse, choose the command, run it, return its exit code."""

from __future__ import annotations

import contextlib
import errno
import gc
import io
import os
import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command line and returns its exit code."""
    try:
        # Imported here, so that Ctrl-C is an orderly end from the first moment on.
        from joshua.cli.parser import parse

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
        # The reader of a pipe has gone: the rest of the output has no recipient.
        sys.stderr.close()
        return ExitCode.OK
    except OSError as error:
        if error.errno != errno.ENOSPC or error.filename is not None:
            raise
        return _unwritten(error)
    return ExitCode.INVALID


def print_version() -> int:
    """Prints the version of the core."""
    from importlib.metadata import version

    sys.stdout.write(f"joshua {version('joshua-core')}\n")
    return ExitCode.OK


def print_completion(shell: str) -> int:
    """Prints the completion script of a shell."""
    from joshua.cli.completion import completion_script
    from joshua.cli.parser import build_parser
    from joshua.cli.plugin_commands import usable_commands

    parser = build_parser(populate=True, further=usable_commands())
    sys.stdout.write(completion_script(parser, shell))
    return ExitCode.OK


def run_configuration(arguments: argparse.Namespace) -> int:
    """Checks a configuration, and runs it unless only the check was asked for."""
    if arguments.validate_only:
        from joshua.cli.validate import validate

        return validate(arguments)
    from joshua.cli.run import run

    return run(arguments)


def program() -> None:
    """What the command ``joshua`` calls: runs the command line and ends the process.

    A check is over in a moment. It collects no garbage meanwhile and is not taken apart at its end, which
    together are a fifth of its time.
    """
    _ready_streams()
    if "--validate-only" in sys.argv:
        gc.disable()
    code = main()
    if "joshua.cli.validate" in sys.modules:
        os._exit(_flushed(code))
    sys.exit(code)


def _ready_streams() -> None:
    """Opens the standard streams that the shell has closed, and lets no character end the program.

    Else a socket could get the number of a stream that native code writes to. A path may hold bytes that are
    no text, and a terminal may know few characters.
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


def _flushed(code: int) -> int:
    """Writes out what is buffered; returns the exit code, another one where that fails."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        pass  # the reader of a pipe has gone, and needs nothing more
    except ValueError:
        pass  # closed, for the same reason
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
