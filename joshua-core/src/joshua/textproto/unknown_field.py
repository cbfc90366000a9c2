"""The error for an unknown field of a block: the nearest names, or the block where it belongs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from joshua.textproto.diagnostics import Span, shortened
from joshua.textproto.nearest import nearest, nearest_first

if TYPE_CHECKING:
    from collections.abc import Sequence

    from joshua.textproto.diagnostics import Diagnostics
    from joshua.textproto.source import Source
    from joshua.textproto.syntax import Field

_DEEPEST = 3


def report_unknown_field(
    problems: Diagnostics, source: Source, around: Sequence[Any], field: Field, path: str
) -> None:
    """Report an unknown field of a block.

    Args:
        around: descriptors of the block and its enclosing ones, the innermost last.
    """
    descriptor = around[-1]
    place = Span(source, field.name_start, field.name_end)
    shown = shortened(field.name, 60)
    if field.is_type:
        message = f"{descriptor.name} takes no type in square brackets."
        problems.error("extension-field", message, place, path=path)
        return
    allowed = nearest_first(field.name, [known.name for known in descriptor.fields])
    remedy = ""
    if field.name.isdigit():
        known = descriptor.fields_by_number.get(int(field.name)) if len(field.name) < 10 else None
        remedy = "Write fields by name, not by number."
        if known is not None:
            allowed = nearest_first(known.name, allowed)
    else:
        home = _home_of(descriptor, field.name)
        owner = next((outer for outer in reversed(around[:-1]) if field.name in outer.fields_by_name), None)
        if home:
            remedy = f"Move it into the block {home}, where {shown} is a field."
        elif owner is not None:
            remedy = f"Close the block above before it with }}: {shown} is a field of {owner.name}."
        elif nearest(field.name, allowed):
            remedy = f"Did you mean {allowed[0]}?"
        elif elsewhere := next(filter(None, (_home_of(outer, field.name) for outer in reversed(around))), ""):
            remedy = f"Move it into the block {elsewhere}, where {shown} is a field."
    problems.error(
        "unknown-field",
        f"{descriptor.name} has no field {shown}.",
        place,
        path=f"{path}.{shown}" if path else shown,
        allowed=allowed,
        remedy=remedy,
    )


def _home_of(descriptor: Any, name: str) -> str:
    """Find the nearest block inside a message with a field of this name; "" for none."""
    level = [(descriptor, "")]
    seen = {descriptor.full_name}
    for _ in range(_DEEPEST):
        below = []
        for message, path in level:
            for field in message.fields:
                inner = field.message_type
                if inner is None or inner.full_name in seen:
                    continue
                seen.add(inner.full_name)
                inner_path = f"{path}.{field.name}" if path else str(field.name)
                if name in inner.fields_by_name:
                    return inner_path
                below.append((inner, inner_path))
        level = below
    return ""
