"""The entry point of a child process: forked by the fork server, or started by another interpreter."""

from __future__ import annotations

import argparse
import faulthandler
import os
import signal
import sys

#: Exit status of a child that failed outside its nodes.
EXIT_INTERNAL = 70


def prepare() -> None:
    """Loads the modules that every child needs. The fork server calls it once before it forks."""
    import joshua.node.process  # noqa: F401 (for those that are forked)
    from joshua.ipc.messages import prepare_child

    prepare_child()


def run_forked(control_descriptor: int, version: str = "", standby_descriptor: int | None = None) -> int:
    """Runs a child process whose standard streams are set up. Returns its exit code.

    Args:
        control_descriptor: of its control socket.
        version: of the core in another environment; "" in the supervisor's environment.
        standby_descriptor: of the socket for the orders of its guardians; None in another environment.
    """
    from joshua.guardian import standby
    from joshua.node.process import NodeProcess

    if standby_descriptor is not None:
        standby.adopt(standby_descriptor)

    # Writes the stacks of all threads to standard error after a crash in native code, and at the supervisor's
    # request for a hung node.
    faulthandler.enable(file=2)
    faulthandler.register(signal.SIGUSR2, file=2, all_threads=True)
    return NodeProcess(control_descriptor, version).run()


def finish(code: int) -> None:
    """Ends the process immediately, without exit handlers and threads of libraries."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            continue  # the reader is gone
    os._exit(code)


def main() -> None:
    """Runs a child process in this interpreter."""
    parser = argparse.ArgumentParser(
        prog="python -m joshua.node.main",
        description="Runs nodes on behalf of the Node Generator, which starts this program itself.",
    )
    parser.add_argument("--control-descriptor", type=int, required=True, help="inherited control socket")
    arguments = parser.parse_args()
    from importlib import metadata  # takes milliseconds, which forked children do not need

    code = EXIT_INTERNAL
    try:
        code = run_forked(arguments.control_descriptor, metadata.version("joshua-core"))
    except BaseException:  # noqa: BLE001 (the process ends here, whatever it was)
        sys.excepthook(*sys.exc_info())
    finally:
        finish(code)


if __name__ == "__main__":
    main()
