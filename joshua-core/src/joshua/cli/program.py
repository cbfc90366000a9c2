"""The entry point of ``joshua``: Ctrl-C during the import of the program exits without a traceback."""

from __future__ import annotations

import os
import signal

from joshua.cli.exit_codes import ExitCode


def program() -> None:
    """Import the program and run it. Before that, there is nothing to shut down."""
    usual = signal.getsignal(signal.SIGINT)
    if usual is signal.default_int_handler:
        signal.signal(signal.SIGINT, lambda _number, _frame: os._exit(ExitCode.INTERRUPTED))
    from joshua.cli import main

    signal.signal(signal.SIGINT, usual)
    main.program()
