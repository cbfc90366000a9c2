"""The rules of each field in the schema: required, range, allowed values, number of entries."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

from joshua.config.checks.context import Block, Context
from joshua.config.checks.device_table import frame_rate, messages_of, type_text
from joshua.config.checks.identity import free_ids
from joshua.plan import Diagnostic
from joshua.schema.rules import block_rule
from joshua.textproto.field_facts import FieldFacts, field_facts, number_text
from joshua.textproto.nearest import nearest_first


def check(context: Context) -> Iterator[Diagnostic]:
    """Check every field of every block against its rule."""
    for block in context.blocks:
        missing = []
        for facts in block.facts:
            if facts.repeated:
                yield from _repeated(context, block, facts)
                if facts.required and not len(getattr(block.message, facts.name)):
                    missing.append(facts)
            elif context.is_set(block, facts.name):
                if not facts.is_message:
                    path = block.field_path(facts.name)
                    yield from _value(context, facts, path, getattr(block.message, facts.name))
            elif facts.required and not any(context.is_set(block, name) for name in facts.required_unless):
                missing.append(facts)
        if missing:
            yield _missing(context, block, missing)
        yield from _limits(context, block)


def _in_words(names: list[str]) -> str:
    """Join names: ``a``, ``a and b``, ``a, b and c``."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _name(block: Block) -> str:
    return block.path.rpartition(".")[2] or "the file"


def _missing(context: Context, block: Block, missing: list[FieldFacts]) -> Diagnostic:
    single = missing[0] if len(missing) == 1 else None
    noun = "block" if single is not None and single.is_message else "field"
    subject = _name(block) if block.path else "The file"
    what = f"the required {noun}{'' if single else 's'} {_in_words([facts.name for facts in missing])}"
    allowed: tuple[str, ...] = ()
    if single is not None and single.enum is not None:
        allowed = _data_types(context, block) or single.value_names()
    elif single is not None and single.range_text():
        allowed = (single.range_text(),)
    return context.error(
        "required-missing",
        f"{subject} lacks {what}",
        block.field_path(single.name) if single else block.path,
        allowed=allowed,
        remedy=f"Add {_in_words([_sample(context, block, facts) for facts in missing])}",
    )


def _data_types(context: Context, block: Block) -> tuple[str, ...]:
    """Types that the device behind a publisher or subscription accepts; () if unknown."""
    item = context.graph.by_path.get(block.path)
    if item is None:
        return ()
    messages = messages_of(item.entry.owner)
    return tuple(map(type_text, (messages.publishes if item.is_publisher else messages.takes) or ()))


def _sample(context: Context, block: Block, facts: FieldFacts) -> str:
    """A field with a value that its device supports."""
    if facts.is_message and facts.message_type.full_name == "joshua.Comm":
        kind = block_rule(block.message.DESCRIPTOR).link or "serial"
        inner = next(link for link in field_facts(facts.message_type) if link.name == kind)
        return f"comm {{ {inner.sample()} }}"
    item = context.graph.by_path.get(block.path)
    if facts.name == "data_type" and (types := _data_types(context, block)):
        return f"data_type: {types[0]}"
    if facts.name == "publish_rate_hz" and item is not None and (fps := frame_rate(item.entry.owner)[1]) > 0:
        return f"publish_rate_hz: {number_text(fps)}"
    text = facts.sample()
    if facts.name in ("node", "node_id"):  # the example in the schema is the same id for all
        path = block.path if facts.name == "node_id" else block.field_path("node")
        text = re.sub(r"(?<=node_id: )\d+", str(free_ids(context).get(path, 1)), text)
    return text


def _repeated(context: Context, block: Block, facts: FieldFacts) -> Iterator[Diagnostic]:
    values = getattr(block.message, facts.name)
    path = block.field_path(facts.name)
    count = len(values)
    if not facts.required or count:
        if count < facts.min_items:
            message = (
                f"{facts.name} of {_name(block)} needs at least {facts.min_items} "
                f"entr{'y' if facts.min_items == 1 else 'ies'}"
            )
            remedy = f"Add {facts.sample()}"
            yield context.error("too-few-entries", message, path, found=f"{count} entries", remedy=remedy)
        if facts.max_items is not None and count > facts.max_items:
            last = f"{path}[{facts.max_items}]"
            yield context.error(
                "too-many-entries",
                f"{facts.name} may have at most {facts.max_items} entries",
                path,
                position=context.position(last),
                found=f"{count} entries",
                allowed=(f"1 to {facts.max_items} entries",),
            )
    if facts.is_message:
        return
    seen: dict[Any, int] = {}
    used = set(values) if facts.allowed else ()
    for index, value in enumerate(values):
        yield from _value(context, facts, f"{path}[{index}]", value)
        if facts.allowed and not facts.may_repeat and value in seen:
            yield context.error(
                "duplicate-entry",
                f'"{value}" appears twice in {facts.name}; each entry may appear once',
                f"{path}[{index}]",
                allowed=tuple(f'"{entry}"' for entry in facts.allowed if entry not in used),
                related=context.see(f"{path}[{seen[value]}]", "first entry"),
            )
        seen.setdefault(value, index)


def _value(context: Context, facts: FieldFacts, path: str, value: Any) -> Iterator[Diagnostic]:
    limits, sample = facts.range_text(), facts.example or facts.default
    subject = f"Each entry of {facts.name}" if facts.repeated else facts.name
    if facts.is_number and facts.is_float and not math.isfinite(value):
        yield context.error(
            "not-finite",
            f"{subject} must be a finite number",
            path,
            allowed=(limits or "any finite number",),
            remedy=f"Write a number such as {sample or '1.0'}",
        )
    elif facts.is_number and not facts.contains(value):
        remedy = "Write a value in this range" + (f", such as {sample}" if sample else "")
        for bound, is_past in ((facts.maximum, float.__gt__), (facts.minimum, float.__lt__)):
            if bound is not None and is_past(float(value), float(bound)):
                remedy = f"Write a value in this range; the nearest is {number_text(bound)}"
        radians = math.radians(value)
        if facts.unit == "rad" and abs(value) > math.tau and facts.contains(radians):
            remedy = f"Write {radians:.4f} if {number_text(value)} is in degrees; angles are in radians"
        yield context.error(
            "out-of-range", f"{subject} must be {limits}", path, allowed=(limits,), remedy=remedy
        )
    elif facts.enum is not None and value == 0 and facts.required:  # unknown numbers are reported by loading
        unset = facts.enum.values[0].name
        yield context.error(
            "not-chosen",
            f"{facts.name} must be chosen; {unset} means “not chosen”",
            path,
            found=unset,
            allowed=facts.value_names(),
            remedy=f"Write one of these names, such as {facts.example or facts.value_names()[0]}",
        )
    elif facts.is_string and facts.required and not value:
        remedy = f"Write a value such as {facts.example}" if facts.example else "Write a value"
        yield context.error("empty-text", f"{facts.name} may not be empty", path, found='""', remedy=remedy)
    elif facts.is_string and facts.allowed and value and value not in facts.allowed:
        allowed = tuple(f'"{entry}"' for entry in nearest_first(value, facts.allowed))
        yield context.error("not-allowed", f'"{value}" is no value of {facts.name}', path, allowed=allowed)


def _limits(context: Context, block: Block) -> Iterator[Diagnostic]:
    """Fields ``…_min`` must be below their ``…_max``."""
    by_name = {facts.name: facts for facts in block.facts if facts.is_number and not facts.repeated}
    is_broken = context.loaded.positions.is_broken
    for name, lower in by_name.items():
        upper = by_name.get(f"{name.removesuffix('_min')}_max") if name.endswith("_min") else None
        if upper is None or not context.is_set(block, upper.name) or is_broken(block.field_path(name)):
            continue
        low, high = getattr(block.message, name), getattr(block.message, upper.name)
        # A value outside its own range is reported separately. Comparing it would repeat that.
        if not (lower.contains(low) and upper.contains(high)) or low < high:
            continue
        reason = "the range is empty" if low == high else "the two look swapped"
        yield context.error(
            "limits-inverted",
            f"{upper.name} must be above {name}; {reason}",
            block.field_path(upper.name),
            found=f"{name} {number_text(low)}, {upper.name} {number_text(high)}",
            allowed=(f"above {number_text(low)} {upper.unit}".rstrip(),),
            remedy="Raise the upper or lower the lower limit" if low == high else "Swap the two values",
            related=context.see(block.field_path(name), name) if context.is_set(block, name) else (),
        )
