"""What the command ``joshua`` calls: Ctrl-C ends it quietly while it is still being imported."""

from __future__ import annotations

import os
import signal

from joshua.cli.exit_codes import ExitCode


def program() -> None:
    """Imports the program and runs it; meanwhile there is nothing to stop, so an interrupt just ends it."""
    usual = signal.getsignal(signal.SIGINT)
    if usual is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)
    from joshua.cli import main

    signal.signal(signal.SIGINT, usual)
    main.program()


def _leave(_number: int, _frame: object) -> None:
    os._exit(ExitCode.INTERRUPTED)
