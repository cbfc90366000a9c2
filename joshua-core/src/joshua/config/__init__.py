"""Text to ``Config``: load, include, override, positions, and the checks."""

from joshua.config.checks import check
from joshua.config.loading import LoadedConfig, load

__all__ = ["LoadedConfig", "check", "load"]
