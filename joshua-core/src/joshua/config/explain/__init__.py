"""``joshua explain``: the documentation of every block, field and value, taken from the schema."""

from joshua.config.explain.catalogue import Catalogue, Place
from joshua.config.explain.pages import explain, overview

__all__ = ["Catalogue", "Place", "explain", "overview"]
