"""Walks through the comments of a text in step with its fields."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from joshua.textproto.lexer import Tokens
    from joshua.textproto.source import Source


class CommentCursor:
    """Hands out each comment once, in the order of the text."""

    def __init__(self, source: Source, tokens: Tokens) -> None:
        self._source = source
        self._tokens = tokens
        self._comments = tokens.comments
        self._comment_starts = [start for start, _ in tokens.comments]
        self._at = 0

    def before(self, limit: int) -> list[tuple[int, str]]:
        """Takes the comments that begin before an offset: the offset of each and its text."""
        taken = []
        while self._at < len(self._comments) and self._comments[self._at][0] < limit:
            taken.append((self._comments[self._at][0], self._text(self._at)))
            self._at += 1
        return taken

    def trailing(self, end: int, skip: int = 0) -> str | None:
        """Takes the comment that follows on the same line, if nothing else stands between.

        Args:
            end: offset after what the comment may follow.
            skip: number of separators after it that do not count.
        """
        if self._at >= len(self._comments):
            return None
        start = self._comments[self._at][0]
        starts = self._tokens.starts
        following = bisect_left(starts, end)
        # Separators count as part of what they end, wherever the comment stands among them.
        before_comment = bisect_left(starts, start)
        last = self._tokens.ends[before_comment - 1] if before_comment else 0
        on_line = self._source.line(start) == self._source.line(max(last - 1, 0))
        if start < end or not on_line or before_comment - following > skip:
            return None
        self._at += 1
        return self._text(self._at - 1)

    def any_between(self, start: int, end: int) -> bool:
        """Tells whether a comment stands in a span of the text."""
        index = bisect_left(self._comment_starts, start)
        return index < len(self._comments) and self._comment_starts[index] < end

    def blank_before(self, offset: int) -> bool:
        """Tells whether an empty line stands before what begins at an offset."""
        token = bisect_left(self._tokens.starts, offset) - 1
        comment = bisect_right(self._comment_starts, offset - 1) - 1
        last = max(
            self._tokens.ends[token] if token >= 0 else 0, self._comments[comment][1] if comment >= 0 else 0
        )
        return self._source.line(offset) - self._source.line(max(last - 1, 0)) >= 2

    def _text(self, index: int) -> str:
        start, end = self._comments[index]
        return self._source.text[start:end].rstrip()
