"""The diagnostics page: every code that a check can report, its cause, and the next step."""

from __future__ import annotations

from joshua.config.codes_fields import FIELD_CODES
from joshua.config.codes_graph import GRAPH_CODES
from joshua.config.codes_modes import MODE_CODES
from joshua.config.codes_planning import PLANNING_CODES
from joshua.config.codes_reading import READING_CODES

from reference.markdown import table

HEAD = """# Diagnostics

What the check of a file can report. The code stands in brackets behind each message, and in the field
`code` of `--format json`. An **error** keeps a file from starting (exit code 2), a **warning** does not,
and a **note** names what is missing on this machine or has no effect.
"""

GROUPS = (
    ("Reading the file", READING_CODES),
    ("Fields and blocks", FIELD_CODES),
    ("Nodes, topics and devices together", GRAPH_CODES),
    ("Operation modes, files and plugins", MODE_CODES),
    ("Plan", PLANNING_CODES),
)


def diagnostics_page() -> str:
    """Makes the page."""
    lines = [HEAD]
    for title, codes in GROUPS:
        rows = [
            (f'<code id="{name}">{name}</code>', document.cause, document.next_step)
            for name, document in sorted(codes.items())
        ]
        lines += [f"## {title}", "", *table(("Code", "Cause", "Next step"), rows)]
    return "\n".join(lines)
