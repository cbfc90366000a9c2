"""The cursor over the tokens, and the parsing of scalars and lists."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from joshua.textproto.diagnostics import Span, shortened
from joshua.textproto.lexer import END, NAME, NUMBER, OPEN_STRING, OTHER, SIGN, STRING
from joshua.textproto.syntax import Block, Field, ListValue, Scalar, ScalarKind

if TYPE_CHECKING:
    from collections.abc import Iterable

    from joshua.textproto.diagnostics import Diagnostics
    from joshua.textproto.lexer import Tokens
    from joshua.textproto.source import Source

_RUN_END = re.compile(r"[\s{}<>\[\],;#]")
_LONGEST_QUOTED = 400
_CURLY_QUOTES = "“”„‟‘’«»"
_KINDS = {NAME: ScalarKind.NAME, NUMBER: ScalarKind.NUMBER, STRING: ScalarKind.STRING}


class ValueParser:
    """A cursor that knows how to read scalars and lists."""

    def __init__(self, source: Source, tokens: Tokens, problems: Diagnostics) -> None:
        self.source = source
        self.tokens = tokens
        self.problems = problems
        self.kinds = tokens.kinds
        self.texts = tokens.texts
        self.at = 0

    @property
    def kind(self) -> int:
        """Kind of the token at the cursor."""
        return self.kinds[self.at]

    @property
    def text(self) -> str:
        """Text of the token at the cursor."""
        return self.texts[self.at]

    @property
    def start(self) -> int:
        """Offset of the token at the cursor."""
        return self.tokens.starts[self.at]

    @property
    def end(self) -> int:
        """Offset after the token at the cursor."""
        return self.tokens.ends[self.at]

    def error(
        self,
        code: str,
        message: str,
        start: int,
        end: int,
        *,
        found: str = "",
        allowed: Iterable[str] = (),
        remedy: str = "",
        related: Iterable[tuple[Span, str]] = (),
    ) -> None:
        """Reports a syntax error."""
        self.problems.error(
            code,
            message,
            Span(self.source, start, end),
            found=found,
            allowed=allowed,
            remedy=remedy,
            related=related,
        )

    def block(self, name: str, opened_at: int | None = None) -> Block:
        """Parses a block; the parser of fields implements it."""
        raise NotImplementedError

    def run_text(self) -> str:
        """The text from the cursor up to white space or a sign that ends values, shortened."""
        return shortened(self.source.text[self.start : self.run_end()])

    def run_end(self) -> int:
        """Offset of the end of that text."""
        return self._run_end_from(self.start)

    def _run_end_from(self, start: int) -> int:
        stop = _RUN_END.search(self.source.text, start + 1)
        return stop.start() if stop is not None else len(self.source.text)

    def scalar(self, name: str) -> Scalar:
        """Parses a scalar; a text that lacks its quotes is reported and taken as one broken scalar."""
        kind = self.kind
        if kind == STRING:
            return self._string()
        if kind == OPEN_STRING:
            return self._open_string()
        start = self.start
        if kind in (NAME, NUMBER) and not self._text_goes_on():
            scalar = Scalar(_KINDS[kind], start, self.end, [self.text], [(start, self.end)])
            self.at += 1
            return scalar
        return self._unquoted(name)

    def _text_goes_on(self) -> bool:
        """Whether a character that no word holds follows the token without white space between."""
        return self.kinds[self.at + 1] == OTHER and self.tokens.starts[self.at + 1] == self.end

    def _string(self) -> Scalar:
        start = self.start
        texts: list[str] = []
        parts: list[tuple[int, int]] = []
        while self.kind == STRING:
            texts.append(self.text)
            parts.append((self.start, self.end))
            self.at += 1
        if self.kind == OPEN_STRING:
            return self._open_string(start)
        return Scalar(ScalarKind.STRING, start, parts[-1][1], texts, parts)

    def _open_string(self, start: int | None = None) -> Scalar:
        quote = self.text[0]
        self.error(
            "unclosed-string",
            "The string is not closed on its line.",
            self.start,
            self.end,
            found=self.text,
            remedy=f"Add {quote} at its end; write a line break inside a string as \\n.",
        )
        begin = self.start if start is None else start
        scalar = Scalar(ScalarKind.BROKEN, begin, self.end, [], [])
        self.at += 1
        return scalar

    def _unquoted(self, name: str) -> Scalar:
        start = self.start
        first = self.text[0]
        end = self.run_end()
        if first in _CURLY_QUOTES:
            end = self._curly_end(end)
        found = self.source.text[start:end]
        bare = found.strip(_CURLY_QUOTES)
        if first in _CURLY_QUOTES:
            message = f"The value of {name} stands in typographic quotes."
        else:
            message = f"The value of {name} is not a number, a name or a quoted string."
        self.error(
            "unquoted-string",
            message,
            start,
            end,
            found=found,
            allowed=(f'"{shortened(bare)}"',),
            remedy="Put a text value in straight double quotes.",
        )
        while self.kind != END and self.start < end:
            self.at += 1
        return Scalar(ScalarKind.BROKEN, start, end, [], [])

    def _curly_end(self, end: int) -> int:
        """Finds the closing typographic quote on the line, so that the words between cause no more errors."""
        furthest = self.start + _LONGEST_QUOTED
        line_end = self.source.text.find("\n", self.start, furthest)
        stop = furthest if line_end == -1 else line_end
        closers = [self.source.text.rfind(quote, self.start + 1, stop) for quote in _CURLY_QUOTES]
        return max(end, max(closers) + 1)

    def list_value(self, field: Field) -> ListValue:
        """Parses a list of scalars or blocks."""
        result = ListValue(self.start, self.end)
        self.at += 1
        if self._at_sign("]"):
            self.at += 1
        else:
            self._items(result, field)
        result.end = self.tokens.ends[self.at - 1]
        return result

    def _items(self, result: ListValue, field: Field) -> None:
        lacks_comma = False
        while not self.problems.full:
            if self._at_sign("{") or self._at_sign("<"):
                result.items.append(self.block(field.name))
            elif self.kind in (END, SIGN) or self._begins_field():
                if not self._missing_item(result):
                    return
                continue
            else:
                result.items.append(self.scalar(field.name))
            if self._at_sign("]"):
                self.at += 1
                return
            if self._at_sign(",") or self._at_sign(";"):
                if self.text == ";":
                    self.error(
                        "missing-comma",
                        "';' stands between entries of a list.",
                        self.start,
                        self.end,
                        found=";",
                        allowed=(",",),
                    )
                comma = self.at
                self.at += 1
                if self._at_sign("]"):
                    self._extra_comma(comma)
                    self.at += 1
                    return
            elif self._begins_item() and not lacks_comma:  # who forgets one forgets all of a list
                lacks_comma = True
                before = self.tokens.ends[self.at - 1]
                self.error(
                    "missing-comma",
                    f"A comma is missing before '{self.run_text()}'.",
                    before,
                    before + 1,
                    allowed=(",",),
                )

    def _missing_item(self, result: ListValue) -> bool:
        """Reports what stands where an entry is expected; False where the list ends there."""
        if self._at_sign(","):
            self._extra_comma(self.at)
            self.at += 1
            if self._at_sign("]"):
                self.at += 1
                return False
            return True
        if self._at_sign("]"):
            self.at += 1
            return False
        if self._at_sign("["):
            self.error(
                "unexpected-text",
                "A list cannot stand inside a list.",
                self.start,
                self.end,
                found="[",
                remedy="Write all entries in one list.",
            )
            self.at += 1
            return True
        self.error(
            "unclosed-list",
            "The list is not closed.",
            result.start,
            result.start + 1,
            found="[",
            allowed=("]",),
        )
        return False

    def _extra_comma(self, at: int) -> None:
        self.error(
            "extra-comma",
            "No entry follows this comma.",
            self.tokens.starts[at],
            self.tokens.ends[at],
            found=",",
        )

    def _begins_item(self) -> bool:
        if self.kind == SIGN:
            return self.text in "{<"
        return self.kind in (NAME, NUMBER, STRING, OTHER) and not self._begins_field()

    def _begins_field(self) -> bool:
        return (
            self.kind == NAME
            and self.kinds[self.at + 1] == SIGN
            and self.texts[self.at + 1] in ":{"
            and self.source.is_first_on_line(self.start)
        )

    def _at_sign(self, sign: str) -> bool:
        return self.kind == SIGN and self.text == sign
