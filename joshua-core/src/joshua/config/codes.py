"""The table of diagnostic codes: what causes each one and what to do about it.

Each group of rules keeps its rows in a ``codes_*.py`` file of its own; this table joins them. The
documentation prints it, and a test holds that no code is raised that it lacks.
"""

from __future__ import annotations

from joshua.config.codes_fields import FIELD_CODES
from joshua.config.codes_graph import GRAPH_CODES
from joshua.config.codes_modes import MODE_CODES
from joshua.config.codes_planning import PLANNING_CODES
from joshua.textproto.code_doc import CodeDoc
from joshua.textproto.codes_reading import READING_CODES

CODES: dict[str, CodeDoc] = {**READING_CODES, **FIELD_CODES, **GRAPH_CODES, **MODE_CODES, **PLANNING_CODES}

__all__ = ["CODES", "CodeDoc"]
