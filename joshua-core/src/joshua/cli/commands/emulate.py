"""``joshua emulate FILE``: run only the emulators of a file, for drivers and tools of any kind."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import ExitStack
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import add_config_options, add_fault_option

if TYPE_CHECKING:
    import argparse

#: Longest delay before a signal is noticed.
LOOK_S = 0.1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua emulate``."""
    add_config_options(parser, file="configuration whose devices are emulated")
    add_fault_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """Start the emulators, print their addresses, and wait for Ctrl-C."""
    from joshua.cli.report import NotStartedError, file_missing, request_of
    from joshua.cli.stand_ins import replace_devices
    from joshua.planner.pipeline import check_file
    from joshua.planner.request import Purpose

    if not arguments.config:
        return file_missing("emulate")
    arguments.emulate, arguments.sim = True, False
    try:
        checked = check_file(request_of(arguments, Purpose.SHOW))
        if checked.result.errors:
            raise NotStartedError.of(checked.result, arguments.format)
        with ExitStack() as stack:
            replace_devices(checked, arguments, stack)
            ended = catch_the_end()  # before printing that a signal ends it
            sys.stdout.write("stop with Ctrl-C\n")
            sys.stdout.flush()
            while not ended.wait(LOOK_S):
                pass
    except NotStartedError as error:
        return error.show()
    return ExitCode.OK


def catch_the_end() -> threading.Event:
    """Set an event when a signal requests the end, on whichever thread it arrives."""
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: ended.set())
    return ended
