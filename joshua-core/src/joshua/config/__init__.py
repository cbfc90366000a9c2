"""Text to ``Config``: load, include, override, positions, and the checks."""

from joshua.config.checks import check

__all__ = ["check"]
