"""Failures of a node, by the exit code that they call for."""

from __future__ import annotations

from typing import ClassVar

#: Exit codes of the program that a node's failure can call for.
EXIT_NODE_FAILED = 1
EXIT_PLUGIN_MISSING = 3
EXIT_DEVICE_REFUSED = 4


class NodeError(Exception):
    """A node cannot do its work; the message says why and what to do."""

    exit_code: ClassVar[int] = EXIT_NODE_FAILED


class InterruptedLifecycleError(BaseException):
    """Breaks whatever the node's thread does, after an orderly stop was asked for in vain.

    Not an ``Exception``, so that a driver's own error handling lets it pass.
    """


def exit_code_of(error: BaseException) -> int:
    """The exit code that a failure calls for: a missing module 3, an absent device 4, else 1."""
    code = getattr(error, "exit_code", None)
    if isinstance(code, int):
        return code
    if isinstance(error, ModuleNotFoundError):
        return EXIT_PLUGIN_MISSING
    return EXIT_NODE_FAILED


class Cancelled(NodeError):
    """A step that takes long ended early, because the node was asked to stop; no failure."""
