"""The plugin contract: declarations of plugins, and the registry of the installed ones.

Nothing here imports a driver, and only ``joshua.plugins.settings`` imports pydantic. Everything is imported
at first use, because the process of a node needs none of it.
"""

from __future__ import annotations

from joshua.plan.lazy import lazy_names, sections

__getattr__, __dir__ = lazy_names(__name__, *sections(__file__).values())
