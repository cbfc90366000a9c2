"""``joshua emulate FILE``: run the emulators of a file alone, for drivers and tools of any kind."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import ExitStack
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse

SUMMARY = "run the emulators of a file alone"

#: How late a signal may be noticed.
LOOK_S = 0.1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of ``joshua emulate``."""
    from joshua.cli.options import add_fault_option

    parser.add_argument("file", metavar="FILE", help="configuration whose devices are emulated")
    add_fault_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """Starts the emulators, prints where each is reached, and waits for Ctrl-C."""
    from joshua.cli.emulation import start_rig
    from joshua.cli.report import exit_code_of, show_findings, state_home_of
    from joshua.planner.pipeline import check_file
    from joshua.planner.request import Request

    checked = check_file(
        Request(arguments.file, arguments.overrides, emulate=True, state_home=state_home_of(emulate=True))
    )
    if checked.result.errors:
        show_findings(checked.result, arguments.format)
        return exit_code_of(checked.result)
    with ExitStack() as stack:
        started = start_rig(checked, arguments, stack)
        if isinstance(started, int):
            return started
        ended = catch_the_end()  # before anybody is told to ask for it
        sys.stdout.write("stop with Ctrl-C\n")
        sys.stdout.flush()
        while not ended.wait(LOOK_S):
            pass
    return ExitCode.OK


def catch_the_end() -> threading.Event:
    """Sets an event when a signal asks for the end, whichever thread the system gives it to."""
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: ended.set())
    return ended
