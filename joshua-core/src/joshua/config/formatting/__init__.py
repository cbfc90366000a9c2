"""``joshua fmt``: one layout for every configuration file, with every comment kept."""

from joshua.config.formatting.equality import same_content
from joshua.config.formatting.layout import format_source

__all__ = ["format_source", "same_content"]
