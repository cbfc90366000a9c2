"""The values between the text of a file and its processes: inert, printable, JSON.

They are loaded at first use, because checking a file does not need the plan, which requires pydantic.
"""

from __future__ import annotations

from joshua.plan.lazy import lazy_names, sections

__getattr__, __dir__ = lazy_names(__name__, *sections(__file__).values())
