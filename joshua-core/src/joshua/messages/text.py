"""Messages as YAML text, for people."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from joshua.messages.fields import PLACEHOLDER, Field, fields

SHOWN_VALUES = 12
"""Number of values shown of a shortened array."""

_PLAIN = re.compile(r"^[A-Za-zÀ-ɏ_/.][\wÀ-ɏ /.+-]*(?<! )$")
_RESERVED = {"true", "false", "null", "yes", "no", "on", "off", "y", "n", "~"}


def message_text(message: Any, *, full: bool = False) -> str:
    """Format a message as block YAML, one field per line.

    Args:
        message: object of a message class.
        full: show every value of a long array instead of the first ones and the count.
    """
    lines = list(_lines(message, "", full))
    return "\n".join(lines) + "\n" if lines else "{}\n"


def _lines(message: Any, indent: str, full: bool) -> Iterator[str]:
    for field in fields(message.__msgtype__):
        if field.wire_name == PLACEHOLDER:
            continue
        value = getattr(message, field.name)
        head = f"{indent}{field.wire_name}:"
        if not field.is_message:
            yield f"{head} {_values(field, value, full)}"
        elif field.shape == "one":
            inner = list(_lines(value, indent + "  ", full))
            yield head if inner else f"{head} {{}}"
            yield from inner
        else:
            yield from _messages(head, value, indent, full)


def _messages(head: str, items: Any, indent: str, full: bool) -> Iterator[str]:
    if not items:
        yield f"{head} []"
        return
    yield head
    shown = len(items) if full else min(len(items), SHOWN_VALUES)
    for item in items[:shown]:
        inner = list(_lines(item, indent + "  ", full)) or [f"{indent}  {{}}"]
        yield f"{indent}- {inner[0].strip()}"
        yield from inner[1:]
    if shown < len(items):
        yield f"{indent}# {len(items)} in all"


def _values(field: Field, value: Any, full: bool) -> str:
    if field.shape == "one":
        return _scalar(field.base, value)
    count = len(value)
    shown = count if full else min(count, SHOWN_VALUES)
    text = ", ".join(_scalar(field.base, item) for item in value[:shown])
    return f"[{text}]" if shown == count else f"[{text}, …]  # {count} values"


def _scalar(base: str, value: Any) -> str:
    if base == "string":
        return _string(value)
    if base == "bool":
        return "true" if value else "false"
    if base.startswith("float"):
        number = float(value)
        if not math.isfinite(number):
            return ".nan" if math.isnan(number) else ".inf" if number > 0 else "-.inf"
        # the shortest text that parses to the same number of that width
        return str(np.float32(value)) if base == "float32" else repr(number)
    return str(int(value))


def _string(text: str) -> str:
    if _PLAIN.match(text) and text.lower() not in _RESERVED:
        return text
    quoted = json.dumps(text, ensure_ascii=False)
    # the text may come from a network: escape terminal controls and bidirectional characters
    return "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in quoted)
