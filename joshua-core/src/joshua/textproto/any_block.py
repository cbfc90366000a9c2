"""Blocks of a plugin's own type: ``plugin_config { [type.example.org/acme.GripperConfig] { … } }``."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from joshua.textproto.nearest import nearest_first
from joshua.textproto.syntax import Block

if TYPE_CHECKING:
    from joshua.textproto.binder import Binder
    from joshua.textproto.syntax import Field

_URL = re.compile(r"[0-9a-zA-Z\-.~_!$&()*+,;=%/]+")
_TYPE_NAME = re.compile(r"[^\d\W]\w*(\.[^\d\W]\w*)*", re.ASCII)
_BAD_PERCENT = re.compile(r"%(?![0-9a-fA-F]{2})")


def bind_any(binder: Binder, message: Any, fields: list[Field], path: str) -> None:
    """Binds the typed form of an ``Any`` block: one type in square brackets with its fields."""
    field = next(field for field in fields if field.is_type)
    for other in fields:
        if other is not field:
            place = binder.span(other.name_start, other.name_end)
            first = binder.span(field.name_start, field.name_end)
            binder.problems.error(
                "mixed-any",
                f"[{field.name}] takes the whole block; nothing else stands beside it.",
                place,
                path=path,
                found=binder.source.text[other.name_start : other.name_end],
                related=[(first, "the type is given here")],
            )
    type_name = _type_name(binder, field, path)
    if type_name is None:
        return
    if field.separator:
        # protobuf's own readers refuse it, so a file with it would be readable here only.
        place = binder.span(field.end, field.end + 1)
        binder.problems.error(
            "unexpected-text",
            f"'{field.separator}' stands after a block with a type in square brackets.",
            place,
            path=path,
            found=field.separator,
            remedy="Delete it.",
        )
    if not isinstance(field.value, Block):
        if field.value is not None:
            binder.problems.error(
                "wrong-type",
                f"[{field.name}] is followed by a block of fields.",
                binder.span(field.value.start, field.value.end),
                path=path,
                allowed=(f"[{field.name}] {{ … }}",),
            )
        return
    prefix = field.name[: -len(type_name)]
    found = binder.merge.types.find(type_name)
    if found is None:
        _report_unknown_type(binder, field, type_name, path)
        # The type stays known, so that the missing plugin can be named.
        message.type_url = field.name
        return
    inner: Any = found()
    binder.block(inner, field.value.fields, path)
    if not inner.IsInitialized():
        missing = inner.FindInitializationErrors()
        binder.problems.error(
            "plugin-block-incomplete",
            f"{type_name} lacks {', '.join(missing)}.",
            binder.span(field.name_start, field.name_end),
            path=path,
            allowed=missing,
        )
        return
    message.Pack(inner, type_url_prefix=prefix)


def _type_name(binder: Binder, field: Field, path: str) -> str | None:
    """Takes the full name of the type out of its URL; reports a malformed one."""
    prefix, slash, name = field.name.rpartition("/")
    fault = ""
    if not slash:
        fault = "lacks the domain and the / before the type"
    elif not prefix or prefix.startswith("/"):
        fault = "lacks the domain before the /"
    elif _URL.fullmatch(field.name) is None or _BAD_PERCENT.search(prefix):
        fault = "holds a character that no type URL holds"
    elif _TYPE_NAME.fullmatch(name) is None:
        fault = "does not end in the full name of a message"
    if not fault:
        return name
    known = binder.merge.types.names()
    allowed = [f"type.googleapis.com/{item}" for item in nearest_first(name or field.name, known)]
    binder.problems.error(
        "bad-type-name",
        f"[{field.name}] {fault}.",
        binder.span(field.name_start, field.name_end),
        path=path,
        found=f"[{field.name}]",
        allowed=[f"[{item}]" for item in allowed],
    )
    return None


def _report_unknown_type(binder: Binder, field: Field, type_name: str, path: str) -> None:
    place = binder.span(field.name_start, field.name_end)
    known = binder.merge.types.names()
    if binder.merge.types.is_misspelt(type_name):
        binder.problems.error(
            "unknown-plugin-type",
            f"No plugin that is installed provides {type_name}.",
            place,
            path=path,
            found=type_name,
            allowed=nearest_first(type_name, known),
        )
    else:
        binder.problems.error(
            "plugin-type-not-installed",
            f"No plugin that is installed provides {type_name}; the fields of this block are not checked.",
            place,
            path=path,
            found=type_name,
            allowed=known,
            is_note=True,
        )
