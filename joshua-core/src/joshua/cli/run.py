"""``joshua --config PATH``: check a file, start its nodes, watch them, stop them."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse

    from joshua.generator.examination import Examination
    from joshua.generator.fork_server import ForkServer


def run(arguments: argparse.Namespace) -> int:
    """Runs one configuration from the check to the last report and returns the exit code."""
    # First of all: the fork server must be forked before any thread or transport exists, and it loads
    # the heavy modules while this process reads the file.
    from joshua.generator import fork_server

    server = fork_server.start()
    try:
        examination = examine(arguments)
        if examination.plan is None:
            return refuse(examination)
        return supervise(examination, server, arguments)
    finally:
        server.close()


def examine(arguments: argparse.Namespace) -> Examination:
    """Loads, checks and plans the file, and shows every finding."""
    from joshua.cli.report import request_of, show_findings
    from joshua.generator.examination import examine as examine_request
    from joshua.generator.request import Purpose

    examination = examine_request(request_of(arguments, Purpose.LAUNCH))
    show_findings(examination, arguments.format)
    return examination


def refuse(examination: Examination) -> int:
    """Says that nothing was started; the findings have been shown."""
    from joshua.cli.report import exit_code_of

    sys.stderr.write("nothing was started\n")
    return exit_code_of(examination)


def supervise(examination: Examination, server: ForkServer, arguments: argparse.Namespace) -> int:
    """Starts the nodes and watches them until the end of the run."""
    raise NotImplementedError
