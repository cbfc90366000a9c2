"""Exit codes of ``joshua``."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit codes of a command."""

    OK = 0
    """Finished, or stopped by the user."""
    FAILED = 1
    """A node failed or the run ended in error."""
    INVALID = 2
    """The configuration or the command line is invalid."""
    NOT_INSTALLED = 3
    """A required plugin or extra is not installed."""
    HARDWARE = 4
    """Hardware is absent or refused."""
    INTERRUPTED = 130
    """Interrupted before the start."""
