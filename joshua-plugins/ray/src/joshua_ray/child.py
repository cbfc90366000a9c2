"""Runs ``joshua`` for a worker, and stops it when the worker ends, even if that is killed.

A run that receives further signals stops without its last checkpoint. So nothing signals the run but the
kernel, once, when the process in between ends: by a signal of the worker, or with the worker.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1


def main() -> int:
    """Run ``joshua`` with the arguments after the first, which is the process id of the worker."""
    _end_with(int(sys.argv[1]))
    # the processes of Ray block the first of them, and a child inherits that
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})
    between = os.getpid()
    child = os.fork()
    if child == 0:
        _end_with(between)
        os.execv(sys.executable, [sys.executable, "-m", "joshua", *sys.argv[2:]])  # noqa: S606
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    return code if code >= 0 else 128 - code


def _end_with(parent: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, ctypes.c_ulong(signal.SIGTERM), 0, 0, 0)
    if os.getppid() != parent:  # it ended before
        os._exit(1)


if __name__ == "__main__":
    sys.exit(main())
