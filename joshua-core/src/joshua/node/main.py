"""The entry point of a child process: forked by the fork server, or started by another interpreter."""

from __future__ import annotations

import argparse
import faulthandler
import os
import signal
import sys

#: Exit status of a child that failed outside of its nodes.
EXIT_INTERNAL = 70


def prepare() -> None:
    """Loads what every child needs; the fork server calls it once before it forks."""
    import joshua.node.process  # noqa: F401 (for those that are forked)
    from joshua.ipc.messages import prepare_child

    prepare_child()


def run_forked(control_descriptor: int, version: str = "") -> int:
    """Runs a child process whose standard streams are set up; returns its exit code.

    Args:
        control_descriptor: of its control socket.
        version: of the core in another environment; "" in that of the supervisor.
    """
    from joshua.node.process import NodeProcess

    # A crash in native code, and the supervisor's question where a hung node hangs, are answered with
    # the stacks of all threads on standard error.
    faulthandler.enable(file=2)
    faulthandler.register(signal.SIGUSR2, file=2, all_threads=True)
    return NodeProcess(control_descriptor, version).run()


def finish(code: int) -> None:
    """Ends the process at once: exit handlers and threads of libraries get no say any more."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            continue  # nobody reads any more
    os._exit(code)


def main() -> None:
    """Runs a child process in this interpreter."""
    parser = argparse.ArgumentParser(
        prog="python -m joshua.node.main",
        description="Runs nodes on behalf of the Node Generator, which starts this program itself.",
    )
    parser.add_argument("--control-descriptor", type=int, required=True, help="inherited control socket")
    arguments = parser.parse_args()
    from importlib import metadata  # takes milliseconds, which forked children need not spend

    code = EXIT_INTERNAL
    try:
        code = run_forked(arguments.control_descriptor, metadata.version("joshua-core"))
    except BaseException:  # noqa: BLE001 (the process ends here, whatever it was)
        sys.excepthook(*sys.exc_info())
    finally:
        finish(code)


if __name__ == "__main__":
    main()
