"""The simulation in place of the devices of a file, as ``--sim`` asks for it."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse

    from joshua.generator.examination import Checked


def start_simulation(checked: Checked, arguments: argparse.Namespace) -> int | None:
    """Rewrites the configuration; returns an exit code where that is refused."""
    from joshua.generator.simulated import NoSimulatorError, StandInError, stand_in

    if arguments.emulate:
        sys.stderr.write("joshua: error: --sim and --emulate exclude each other: choose one\n")
        return ExitCode.INVALID
    try:
        names = stand_in(checked.loaded.config, checked.registry)
    except StandInError as error:
        sys.stderr.write(f"joshua: error: {error}\nnothing was started\n")
        return ExitCode.NOT_INSTALLED if isinstance(error, NoSimulatorError) else ExitCode.INVALID
    sys.stdout.write(f"simulated: {', '.join(names)}\n")
    sys.stdout.flush()
    return None
