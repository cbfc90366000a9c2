"""The rules that each field carries in the schema: required, range, allowed values, number of entries."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from joshua.config.checks.blocks import Block
from joshua.config.checks.context import Context
from joshua.config.checks.device_table import frame_rate, messages_of
from joshua.config.checks.topics import type_text
from joshua.plan import Diagnostic
from joshua.schema.rules import block_rule
from joshua.textproto.field_facts import FieldFacts, field_facts, number_text
from joshua.textproto.nearest import nearest_first


def check(context: Context) -> Iterator[Diagnostic]:
    """Holds every field of every block against the rule beside it."""
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


def block_name(block: Block) -> str:
    """What a block is called in a message: the last part of its path, or «the file»."""
    return block.path.rpartition(".")[2] or "the file"


def in_words(names: list[str]) -> str:
    """Joins names: ``a``, ``a and b``, ``a, b and c``."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _missing(context: Context, block: Block, missing: list[FieldFacts]) -> Diagnostic:
    names = [facts.name for facts in missing]
    single = missing[0] if len(missing) == 1 else None
    noun = "block" if single is not None and single.is_message else "field"
    subject = block_name(block) if block.path else "The file"
    what = f"the required {noun}{'' if single else 's'} {in_words(names)}"
    endpoint = _Endpoint(context, block.path)
    allowed: tuple[str, ...] = ()
    if single is not None and single.enum is not None:
        allowed = endpoint.data_types or single.value_names()
    elif single is not None and single.range_text():
        allowed = (single.range_text(),)
    return context.error(
        "required-missing",
        f"{subject} lacks {what}",
        block.field_path(single.name) if single else block.path,
        allowed=allowed,
        remedy=f"Add {in_words([_link(block, facts) or endpoint.sample(facts) for facts in missing])}",
    )


def _link(block: Block, facts: FieldFacts) -> str:
    """The link of a device with the kind that it needs, serial where it takes either; "" for other fields."""
    if not facts.is_message or facts.message_type.full_name != "joshua.Comm":
        return ""
    kind = block_rule(block.message.DESCRIPTOR).link or "serial"
    inner = next(link for link in field_facts(facts.message_type) if link.name == kind)
    return f"comm {{ {inner.sample()} }}"


class _Endpoint:
    """What the device behind a publisher or subscription can do; knows nothing of other blocks."""

    def __init__(self, context: Context, path: str) -> None:
        self._item = context.graph.by_path.get(path)

    @property
    def data_types(self) -> tuple[str, ...]:
        """Names of the types that it can publish or listen to; empty where that is not known."""
        if self._item is None:
            return ()
        messages = messages_of(self._item.entry.owner)
        numbers = messages.publishes if self._item.is_publisher else messages.hears
        return tuple(map(type_text, numbers or ()))

    def sample(self, facts: FieldFacts) -> str:
        """A field with a value that this device can keep."""
        if facts.name == "data_type" and self.data_types:
            return f"data_type: {self.data_types[0]}"
        if facts.name == "publish_rate_hz" and self._item is not None:
            _, fps = frame_rate(self._item.entry.owner)
            if fps > 0:
                return f"publish_rate_hz: {number_text(fps)}"
        return facts.sample()


def _repeated(context: Context, block: Block, facts: FieldFacts) -> Iterator[Diagnostic]:
    values = getattr(block.message, facts.name)
    path = block.field_path(facts.name)
    count = len(values)
    if not facts.required or count:
        if count < facts.min_items:
            yield context.error(
                "too-few-entries",
                f"{facts.name} of {block_name(block)} needs at least {facts.min_items} "
                f"entr{'y' if facts.min_items == 1 else 'ies'}",
                path,
                found=f"{count} entries",
                remedy=f"Add {facts.sample()}",
            )
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
                f'"{value}" stands twice in {facts.name}, where each entry may stand once',
                f"{path}[{index}]",
                allowed=tuple(f'"{entry}"' for entry in facts.allowed if entry not in used),
                related=context.see(f"{path}[{seen[value]}]", "first entry"),
            )
        seen.setdefault(value, index)


def _value(context: Context, facts: FieldFacts, path: str, value: Any) -> Iterator[Diagnostic]:
    if facts.is_number:
        yield from _number(context, facts, path, value)
    elif facts.enum is not None:
        yield from _enum(context, facts, path, value)
    elif facts.is_string:
        yield from _string(context, facts, path, value)


def _number(context: Context, facts: FieldFacts, path: str, value: float) -> Iterator[Diagnostic]:
    limits = facts.range_text()
    if facts.is_float and not math.isfinite(value):
        yield context.error(
            "not-finite",
            f"{_subject(facts)} must be a finite number",
            path,
            allowed=(limits,) if limits else ("any finite number",),
            remedy=f"Write a number such as {facts.example or facts.default or '1.0'}",
        )
    elif not facts.contains(value):
        yield context.error(
            "out-of-range",
            f"{_subject(facts)} must be {limits}",
            path,
            allowed=(limits,),
            remedy=_range_remedy(facts, value),
        )


def _subject(facts: FieldFacts) -> str:
    return f"Each entry of {facts.name}" if facts.repeated else facts.name


def _range_remedy(facts: FieldFacts, value: float) -> str:
    if facts.maximum is not None and value > facts.maximum:
        return f"Write a value in this range; the nearest is {number_text(facts.maximum)}"
    if facts.minimum is not None and value < facts.minimum:
        return f"Write a value in this range; the nearest is {number_text(facts.minimum)}"
    sample = facts.example or facts.default
    return f"Write a value in this range, such as {sample}" if sample else "Write a value in this range"


def _enum(context: Context, facts: FieldFacts, path: str, value: int) -> Iterator[Diagnostic]:
    assert facts.enum is not None
    # A number without a name has been reported by loading.
    if value == 0 and facts.required:
        yield context.error(
            "not-chosen",
            f"{facts.name} must be chosen; {facts.enum.values[0].name} stands for «not chosen»",
            path,
            found=facts.enum.values[0].name,
            allowed=facts.value_names(),
            remedy=f"Write one of these names, such as {facts.example or facts.value_names()[0]}",
        )


def _string(context: Context, facts: FieldFacts, path: str, value: str) -> Iterator[Diagnostic]:
    if facts.required and not value:
        yield context.error(
            "empty-text",
            f"{facts.name} may not be empty",
            path,
            found='""',
            remedy=f"Write a value such as {facts.example}" if facts.example else "Write a value",
        )
    elif facts.allowed and value and value not in facts.allowed:
        yield context.error(
            "not-allowed",
            f'"{value}" is no value of {facts.name}',
            path,
            allowed=tuple(f'"{entry}"' for entry in nearest_first(value, facts.allowed)),
        )
