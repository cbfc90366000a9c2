"""From text to ``Config``: loading, includes, overrides, positions, and checks."""

from joshua.config.checks import check
from joshua.config.loading import LoadedConfig, load

__all__ = ["LoadedConfig", "check", "load"]
