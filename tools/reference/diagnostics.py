"""The diagnostics page: every code that a check can report, its cause, and the next step."""

from __future__ import annotations

from joshua.config.codes import GROUPS

from reference.finding_examples import example_messages
from reference.markdown import table

HEAD = """# Diagnostics

What the check of a file can report. The code stands in brackets behind each message, and in the field
`code` of `--format json`. An **error** keeps a file from starting (exit code 2, or 3 where a plugin is
missing), a **warning** does not, and a **note** names what is missing on this machine or has no effect.
"""

JSON_FORM = """## Findings as JSON

`joshua --config FILE --validate-only --format json` prints one JSON array on standard output, sorted by file
and place. Lines and columns count from 1, columns in characters (Unicode code points); `end_column` is the
column after the last character. A finding that belongs to no place in a file has `null` for file, line and
columns. Fields are added in later versions, never renamed or removed.

| Field | Type | Content |
|---|---|---|
| `code` | string | the code of this page |
| `severity` | string | `error`, `warning` or `note` |
| `message` | string | what is wrong and why |
| `file`, `line`, `column`, `end_line`, `end_column` | string, numbers | the place |
| `field_path` | string | such as `robot.actions[0].node.node_name`; empty where none applies |
| `found` | string | what stands there; empty where nothing does |
| `allowed` | list of strings | what may stand there, the nearest first |
| `remedy` | string | what to do next |
| `related` | list of objects | further places: `label` and the five fields of a place |
"""

SECTIONS = (
    ("Reading the file", GROUPS["reading"]),
    ("Fields and blocks", GROUPS["fields"]),
    ("Nodes, topics and devices together", GROUPS["graph"]),
    ("Operation modes, files and plugins", GROUPS["modes"]),
    ("Plan", GROUPS["planning"]),
)


def diagnostics_page() -> str:
    """Makes the page."""
    examples = example_messages()
    lines = [HEAD]
    for title, codes in SECTIONS:
        rows = [
            (
                f'<code id="{name}">{name}</code>',
                examples.get(name, ""),
                document.cause,
                document.next_step,
            )
            for name, document in sorted(codes.items())
        ]
        lines += [f"## {title}", "", *table(("Code", "Such as", "Cause", "Next step"), rows)]
    return "\n".join([*lines, JSON_FORM])
