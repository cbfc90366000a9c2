"""``joshua fmt``: two spaces per block, one field per line, comments kept in place.

A block on one line stays on one line if it fits. A list that fits becomes one line. Values are unchanged.
Separators between fields, which have no meaning, are removed.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import Counter
from typing import TYPE_CHECKING

from joshua.textproto.syntax import Block, Field, ListValue, Scalar

if TYPE_CHECKING:
    from joshua.textproto.lexer import Tokens
    from joshua.textproto.source import Source
    from joshua.textproto.syntax import Value

_WIDTH = 110
_STEP = "  "


def format_source(source: Source, tokens: Tokens, fields: list[Field]) -> str:
    """Return the formatted text of a source without syntax errors.

    Args:
        tokens, fields: output of the lexer and the parser.
    """
    layout = _Layout(source, tokens)
    layout.fields(fields, len(source.text) + 1, "")
    return "".join(f"{line}\n" for line in layout.lines)


def same_content(one: tuple[Source, Tokens, list[Field]], other: tuple[Source, Tokens, list[Field]]) -> bool:
    """Whether two parsed texts have the same fields in the same order, and the same comments.

    The last check before a formatted file replaces the original.
    """
    return _content(one[2]) == _content(other[2]) and _comments(one) == _comments(other)


def _content(item: object) -> object:
    if isinstance(item, list):
        return [_content(inner) for inner in item]
    if isinstance(item, Field):
        return (item.name, item.is_type, _content(item.value))
    if isinstance(item, Scalar):
        return (item.kind, item.texts)
    if isinstance(item, Block):
        return ("block", _content(item.fields))
    return ("list", _content(item.items)) if isinstance(item, ListValue) else None


def _comments(parsed: tuple[Source, Tokens, list[Field]]) -> Counter[str]:
    source, tokens, _ = parsed
    return Counter(source.text[start:end].rstrip() for start, end in tokens.comments)


class _CommentCursor:
    """Returns each comment once, in the order of the text."""

    def __init__(self, source: Source, tokens: Tokens) -> None:
        self._source = source
        self._tokens = tokens
        self._comments = tokens.comments
        self._starts = [start for start, _ in tokens.comments]
        self._at = 0

    def before(self, limit: int) -> list[tuple[int, str]]:
        """Take the comments that begin before an offset: the offset and text of each."""
        taken = []
        while self._at < len(self._starts) and self._starts[self._at] < limit:
            taken.append((self._starts[self._at], self._take()))
        return taken

    def trailing(self, end: int, skip: int = 0) -> str | None:
        """Take the comment that follows on the same line, if nothing else is between.

        Args:
            end: offset after which the comment may follow.
            skip: number of separators after it to ignore.
        """
        if self._at >= len(self._starts):
            return None
        start = self._starts[self._at]
        following = bisect_left(self._tokens.starts, end)
        # Separators belong to the field that they end, wherever the comment is among them.
        before_comment = bisect_left(self._tokens.starts, start)
        last = self._tokens.ends[before_comment - 1] if before_comment else 0
        on_line = self._source.line(start) == self._source.line(max(last - 1, 0))
        if start < end or not on_line or before_comment - following > skip:
            return None
        return self._take()

    def any_between(self, start: int, end: int) -> bool:
        """Whether a span of the text contains a comment."""
        index = bisect_left(self._starts, start)
        return index < len(self._starts) and self._starts[index] < end

    def blank_before(self, offset: int) -> bool:
        """Whether an empty line precedes an offset."""
        token = bisect_left(self._tokens.starts, offset) - 1
        comment = bisect_right(self._starts, offset - 1) - 1
        last = max(
            self._tokens.ends[token] if token >= 0 else 0, self._comments[comment][1] if comment >= 0 else 0
        )
        return self._source.line(offset) - self._source.line(max(last - 1, 0)) >= 2

    def _take(self) -> str:
        start, end = self._comments[self._at]
        self._at += 1
        return self._source.text[start:end].rstrip()


class _Layout:
    def __init__(self, source: Source, tokens: Tokens) -> None:
        self.lines: list[str] = []
        self._source = source
        self._comments = _CommentCursor(source, tokens)
        self._at_start = True  # of the file or of a block, where empty lines are removed

    def fields(self, fields: list[Field], end: int, indent: str) -> None:
        """Writes the fields of a block, and the comments up to its end."""
        for field in fields:
            value = field.value
            self._own_lines(field.name_start, indent)
            self._blank(field.name_start)
            # A comment inside a field moves above it.
            self._moved(value.start if isinstance(value, Block | ListValue) else field.end, indent)
            if isinstance(value, Block):
                self._block(value, f"{indent}{_name(field)} ", "", indent)
            elif isinstance(value, ListValue):
                self._list(value, f"{indent}{_name(field)}: ", indent)
            elif isinstance(value, Scalar):
                self._scalar(value, f"{indent}{_name(field)}:", indent)
            self._trail(field.end, skip=1 if field.separator else 0)
        self._own_lines(end, indent)

    def _scalar(self, value: Scalar, head: str, indent: str) -> None:
        if len({self._source.line(start) for start, _ in value.parts}) == 1:
            self._line(f"{head} {_inline(value)}")
            return
        self._line(head)
        for text in value.texts:
            self._line(f"{indent}{_STEP}{text}")

    def _block(self, block: Block, head: str, tail: str, indent: str) -> None:
        if self._stays_inline(block, len(head) + len(tail)):
            self._line(f"{head}{_inline(block)}{tail}")
            return
        self._line(f"{head}{{")
        self._trail(block.start + 1)
        self._at_start = True
        self.fields(block.fields, block.end - 1, indent + _STEP)
        self._line(f"{indent}}}{tail}")

    def _list(self, value: ListValue, head: str, indent: str) -> None:
        if self._stays_inline(value, len(head)):
            self._line(f"{head}{_inline(value)}")
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
            if isinstance(item, Block):
                self._block(item, inner, comma, inner)
            else:
                self._line(f"{inner}{_inline(item)}{comma}")
            self._trail(item.end, skip=1 if comma else 0)
        self._own_lines(value.end - 1, inner)
        self._line(f"{indent}]")

    def _stays_inline(self, value: Block | ListValue, beside: int) -> bool:
        """Whether to write a value on one line: it fits, has no comment, and a block was on one line.

        Args:
            beside: number of characters that share the line.
        """
        if self._comments.any_between(value.start, value.end):
            return False
        if isinstance(value, ListValue):
            blocks = [item for item in value.items if isinstance(item, Block)]
            was_inline = all(self._stays_inline(block, 0) for block in blocks)
        elif not value.fields:
            return True
        else:
            was_inline = self._source.line(value.start) == self._source.line(value.end - 1)
        return was_inline and beside + len(_inline(value)) <= _WIDTH

    def _line(self, text: str) -> None:
        self.lines.append(text)
        self._at_start = False

    def _blank(self, offset: int) -> None:
        """Keeps one of the empty lines before an offset."""
        if not self._at_start and self._comments.blank_before(offset):
            self.lines.append("")

    def _own_lines(self, limit: int, indent: str) -> None:
        """Writes the comments before an offset, each on a separate line."""
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


def _name(field: Field) -> str:
    return f"[{field.name}]" if field.is_type else field.name


def _inline(value: Value | None) -> str:
    """A value on one line."""
    if isinstance(value, Scalar):
        return " ".join(value.texts)
    if isinstance(value, ListValue):
        return f"[{', '.join(_inline(item) for item in value.items)}]"
    fields = value.fields if value is not None else []
    words = (
        f"{_name(field)}{'' if isinstance(field.value, Block) else ':'} {_inline(field.value)}"
        for field in fields
    )
    return f"{{ {' '.join(words)} }}" if fields else "{}"
