"""The layout: two spaces for each block, one field to a line, comments where they belong.

A block or list that its author wrote on one line stays on one line while it fits; a list that fits becomes
one. Values stay as they are written; separators between fields, which have no meaning, are left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from joshua.textproto.formatting.comment_cursor import CommentCursor
from joshua.textproto.syntax import Block, Field, ListValue, Scalar

if TYPE_CHECKING:
    from joshua.textproto.lexer import Tokens
    from joshua.textproto.source import Source

_WIDTH = 110
_STEP = "  "


def format_source(source: Source, tokens: Tokens, fields: list[Field]) -> str:
    """Returns the formatted text of a source that has no syntax errors.

    Args:
        tokens, fields: what the lexer and the parser made of it.
    """
    layout = _Layout(source, tokens)
    layout.fields(fields, len(source.text) + 1, "")
    return "".join(f"{line}\n" for line in layout.lines)


class _Layout:
    def __init__(self, source: Source, tokens: Tokens) -> None:
        self.lines: list[str] = []
        self._source = source
        self._comments = CommentCursor(source, tokens)
        self._at_start = True  # of the file or of a block, where no empty line stands

    def fields(self, fields: list[Field], end: int, indent: str) -> None:
        """Writes the fields of a block, and the comments up to its end."""
        for field in fields:
            self._own_lines(field.name_start, indent)
            self._blank(field.name_start)
            # A comment in the midst of a field moves above it.
            self._moved(_head_end(field), indent)
            self._field(field, indent)
            self._trail(field.end, skip=1 if field.separator else 0)
        self._own_lines(end, indent)

    def _field(self, field: Field, indent: str) -> None:
        name = f"[{field.name}]" if field.is_type else field.name
        value = field.value
        if isinstance(value, Block):
            inline = self._inline_block(value, f"{indent}{name} ")
            if inline is not None:
                self._line(inline)
            else:
                self._block(value, f"{indent}{name} {{", "}", indent)
        elif isinstance(value, ListValue):
            self._list(value, f"{indent}{name}: ", indent)
        elif isinstance(value, Scalar):
            self._scalar(value, f"{indent}{name}:", indent)

    def _scalar(self, value: Scalar, head: str, indent: str) -> None:
        lines = {self._source.line(start) for start, _ in value.parts}
        if len(lines) == 1:
            self._line(f"{head} {_scalar_text(value)}")
            return
        self._line(head)
        for text in value.texts:
            self._line(f"{indent}{_STEP}{text}")

    def _block(self, block: Block, head: str, foot: str, indent: str) -> None:
        self._line(head)
        self._trail(block.start + 1)
        self._at_start = True
        self.fields(block.fields, block.end - 1, indent + _STEP)
        self._line(f"{indent}{foot}")

    def _list(self, value: ListValue, head: str, indent: str) -> None:
        inline = self._inline_list(value)
        if inline is not None and len(head) + len(inline) <= _WIDTH:
            self._line(f"{head}{inline}")
            return
        self._line(f"{head}[")
        self._trail(value.start + 1)
        self._at_start = True
        inner = indent + _STEP
        for item in value.items:
            comma = "," if item is not value.items[-1] else ""
            self._own_lines(item.start, inner)
            self._blank(item.start)
            self._moved(item.start + 1 if isinstance(item, Block) else item.end, inner)
            if isinstance(item, Scalar):
                self._line(f"{inner}{_scalar_text(item)}{comma}")
            else:
                text = self._inline_block(item, inner, comma)
                if text is not None:
                    self._line(text)
                else:
                    self._block(item, f"{inner}{{", f"}}{comma}", inner)
            self._trail(item.end, skip=1 if comma else 0)
        self._own_lines(value.end - 1, inner)
        self._line(f"{indent}]")

    def _inline_block(self, block: Block, head: str, tail: str = "") -> str | None:
        """Writes a block on one line; None where it was not, holds a comment, or would not fit."""
        if self._comments.any_between(block.start, block.end):
            return None
        if not block.fields:
            return f"{head}{{}}{tail}"
        if self._source.line(block.start) != self._source.line(block.end - 1):
            return None
        text = f"{head}{{ {self._inline_fields(block.fields)} }}{tail}"
        return text if len(text) <= _WIDTH else None

    def _inline_fields(self, fields: list[Field]) -> str:
        return " ".join(self._inline_field(field) for field in fields)

    def _inline_field(self, field: Field) -> str:
        name = f"[{field.name}]" if field.is_type else field.name
        value = field.value
        if isinstance(value, Block):
            return f"{name} {self._inline_item(value)}"
        if isinstance(value, ListValue):
            return f"{name}: [{', '.join(self._inline_item(item) for item in value.items)}]"
        return f"{name}: {self._inline_item(value)}" if value is not None else name

    def _inline_item(self, item: Scalar | Block) -> str:
        if isinstance(item, Scalar):
            return _scalar_text(item)
        return f"{{ {self._inline_fields(item.fields)} }}" if item.fields else "{}"

    def _inline_list(self, value: ListValue) -> str | None:
        """Writes a list on one line; None where it holds a comment or a block that was not on one."""
        if self._comments.any_between(value.start, value.end):
            return None
        for item in value.items:
            if isinstance(item, Block) and self._inline_block(item, "") is None:
                return None
        return f"[{', '.join(self._inline_item(item) for item in value.items)}]"

    def _line(self, text: str) -> None:
        self.lines.append(text)
        self._at_start = False

    def _blank(self, offset: int) -> None:
        """Keeps one of the empty lines that stand before an offset."""
        if not self._at_start and self._comments.blank_before(offset):
            self.lines.append("")

    def _own_lines(self, limit: int, indent: str) -> None:
        """Writes the comments before an offset, each on a line of its own."""
        for start, text in self._comments.before(limit):
            self._blank(start)
            self._line(f"{indent}{text}")

    def _moved(self, limit: int, indent: str) -> None:
        for _, text in self._comments.before(limit):
            self._line(f"{indent}{text}")

    def _trail(self, end: int, skip: int = 0) -> None:
        """Appends the comment that follows on the same line."""
        text = self._comments.trailing(end, skip)
        if text is not None:
            self.lines[-1] += f"  {text}"


def _head_end(field: Field) -> int:
    """Offset up to which a comment stands in the midst of a field: before its block or list, or its end."""
    value = field.value
    if isinstance(value, Block | ListValue):
        return value.start
    return field.end


def _scalar_text(value: Scalar) -> str:
    return " ".join(value.texts)
