"""``joshua fmt``: one layout for every configuration file, with every comment kept."""

from joshua.textproto.formatting.equality import same_content
from joshua.textproto.formatting.layout import format_source

__all__ = ["format_source", "same_content"]
