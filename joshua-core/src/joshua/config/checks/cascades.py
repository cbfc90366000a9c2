"""Leaves out findings that only repeat what loading has reported already.

A block that could not be read is not «missing», and a topic is not «unpublished» when the publisher
next to the syntax error was skipped.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from joshua.plan import Diagnostic, Severity

# Findings about something that is absent from a block.
_ABSENT_FIELD = frozenset(("required-missing", "too-few-entries", "block-missing", "link-missing"))
# Findings about something that is absent from the file.
_ABSENT_PART = frozenset(
    (
        "topic-unpublished",
        "sensor-unpublished",
        "calibration-unknown-node",
        "calibration-incomplete",
        "hosts-apart",
        "weights-missing",
        "tls-missing",
        "tls-unused",
    )
)
# Errors of loading after which a part of the text is not in the configuration, wherever it belonged.
_TEXT_LOST = frozenset(("include", "syntax"))
# Fields whose loss takes more with it than themselves.
_STRUCTURE = frozenset(
    (
        "actions",
        "ai",
        "calibration",
        "models",
        "node",
        "node_name",
        "perceptions",
        "publishers",
        "robot",
        "ros_namespace",
        "subscriptions",
        "topic_name",
        "transport",
    )
)


def without_cascades(
    findings: Iterable[Diagnostic], loading: Sequence[Diagnostic], absent: frozenset[str] = frozenset()
) -> list[Diagnostic]:
    """Drops the findings that follow from errors of loading.

    Args:
        findings: of the checks; loading: of the loader.
        absent: further codes that say that a part of the file is absent.
    """
    errors = [item for item in loading if item.severity is Severity.ERROR]
    if not errors:
        return list(findings)
    bad_paths = [item.field_path for item in errors if item.field_path]
    text_lost = any(item.code.startswith(tuple(_TEXT_LOST)) or not item.field_path for item in errors)
    structure_lost = text_lost or any(_names(item) & _STRUCTURE for item in errors)
    mistyped = {
        f"{item.field_path.rpartition('.')[0]}.{name}".lstrip(".") for item in errors for name in _names(item)
    }
    kept = []
    for item in findings:
        if any(_covers(path, item.field_path) for path in bad_paths):
            continue
        if item.code in _ABSENT_PART | absent and structure_lost:
            continue
        if item.code in _ABSENT_FIELD and (text_lost or _is_mistyped(item, mistyped)):
            continue
        kept.append(item)
    return kept


def _names(item: Diagnostic) -> set[str]:
    """The field that an error is about, and the names that it was probably meant to be."""
    last = item.field_path.rpartition(".")[2].partition("[")[0]
    return {last, *item.allowed[:1]}


def _is_mistyped(item: Diagnostic, mistyped: set[str]) -> bool:
    """Whether a field that is absent stands there under another spelling."""
    if item.field_path in mistyped:
        return True
    # A finding about several absent fields carries the path of their block.
    return any(name.rpartition(".")[0] == item.field_path for name in mistyped)


def _covers(outer: str, inner: str) -> bool:
    return inner == outer or inner.startswith((f"{outer}.", f"{outer}["))
