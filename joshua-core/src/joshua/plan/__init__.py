"""The values on the road from text to processes: inert, printable, JSON.

They are loaded at first use: a file is checked without the plan, which needs pydantic.
"""

from __future__ import annotations

from joshua.plan.lazy import lazy_names, sections

__getattr__, __dir__ = lazy_names(__name__, *sections(__file__).values())
