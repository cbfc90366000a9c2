"""Lower limits lie below upper limits."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.config.checks.blocks import Block
from joshua.config.checks.context import Context
from joshua.plan import Diagnostic
from joshua.textproto.field_facts import FieldFacts, number_text


def check(context: Context) -> Iterator[Diagnostic]:
    """Compares each pair of fields ``…_min`` and ``…_max`` of a block."""
    for block in context.blocks:
        by_name = {facts.name: facts for facts in block.facts if facts.is_number and not facts.repeated}
        for name, lower in by_name.items():
            upper = by_name.get(f"{name.removesuffix('_min')}_max") if name.endswith("_min") else None
            if upper is not None and context.is_set(block, upper.name) and not _broken(context, block, name):
                yield from _pair(context, block, lower, upper)


def _pair(context: Context, block: Block, lower: FieldFacts, upper: FieldFacts) -> Iterator[Diagnostic]:
    low, high = getattr(block.message, lower.name), getattr(block.message, upper.name)
    # A value outside its own range is reported for itself; comparing it would only repeat that.
    if not (lower.contains(low) and upper.contains(high)) or low < high:
        return
    equal = low == high
    path = block.field_path(upper.name)
    yield context.error(
        "limits-inverted",
        f"{upper.name} must be above {lower.name}"
        + (", or the range is empty" if equal else "; the two look exchanged"),
        path,
        found=f"{lower.name} {number_text(low)}, {upper.name} {number_text(high)}",
        allowed=(f"above {number_text(low)}" + (f" {upper.unit}" if upper.unit else ""),),
        remedy="Raise the upper or lower the lower limit" if equal else "Exchange the two values",
        related=context.see(block.field_path(lower.name), lower.name)
        if context.is_set(block, lower.name)
        else (),
    )


def _broken(context: Context, block: Block, name: str) -> bool:
    return context.loaded.positions.is_broken(block.field_path(name))
