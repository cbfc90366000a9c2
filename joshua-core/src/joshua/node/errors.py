"""Failures of a node, by their exit code."""

from __future__ import annotations

from typing import ClassVar

#: Exit codes of the program for a node's failure.
EXIT_NODE_FAILED = 1
EXIT_FILE_WRONG = 2
EXIT_PLUGIN_MISSING = 3
EXIT_DEVICE_REFUSED = 4


class NodeError(Exception):
    """A node cannot do its work. The message says why and what to do."""

    exit_code: ClassVar[int] = EXIT_NODE_FAILED

    #: Whether the failure cannot differ after a restart, so that the node is not restarted.
    is_permanent: bool = False


class InterruptedLifecycleError(BaseException):
    """Interrupts the node's thread, if it did not react to a stop request.

    Not an ``Exception``, so that a driver's error handling does not catch it.
    """


def exit_code_of(error: BaseException) -> int:
    """The exit code of a failure: 2 for a wrong file, 3 for a missing module, 4 for a device, else 1."""
    code = getattr(error, "exit_code", None)
    if isinstance(code, int):
        return code
    if isinstance(error, ModuleNotFoundError):
        return EXIT_PLUGIN_MISSING
    return EXIT_NODE_FAILED


def is_permanent(error: BaseException) -> bool:
    """Whether an error says that a restart would meet it again, as a missing field or broken weights."""
    return getattr(error, "is_permanent", False) is True


class Cancelled(NodeError):
    """A long step ended early because the node was asked to stop. No failure."""
