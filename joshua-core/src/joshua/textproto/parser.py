"""From tokens to a syntax tree. After an error, it continues at the next field and finds all errors.

Why one file: one class, whose scalars, lists, blocks and fields recover from each other's errors.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, NamedTuple

from joshua.textproto.diagnostics import shortened
from joshua.textproto.lexer import END, NAME, NUMBER, OPEN_STRING, OTHER, SIGN, STRING, tokenize
from joshua.textproto.limits import MAX_DEPTH, MAX_TOKENS
from joshua.textproto.source import Span
from joshua.textproto.syntax import Block, Field, ListValue, Scalar, ScalarKind

if TYPE_CHECKING:
    from joshua.textproto.diagnostics import Diagnostics
    from joshua.textproto.lexer import Tokens
    from joshua.textproto.source import Source

_RUN_END = re.compile(r"[\s{}<>\[\],;#]")
_LONGEST_QUOTED = 400
_CURLY_QUOTES = "“”„‟‘’«»"
_KINDS = {NAME: ScalarKind.NAME, NUMBER: ScalarKind.NUMBER}
_CLOSER = {"{": "}", "<": ">"}
_PARTNER = {"}": "{", ">": "<", "]": "["}
# Below this share of indented lines, the layout of a file does not reveal its blocks.
_LAID_OUT = 0.5


class _Open(NamedTuple):
    """An open block: its name and opening brace, and the layout of that line.

    Attributes:
        is_assumed: whether its opening brace is missing, so that only its indentation bounds it.
    """

    name: str
    brace: Span
    closer: str
    line: int
    indentation: int
    is_assumed: bool


class Parser:
    """Parses one text. Errors go to ``problems``.

    It tracks the open blocks. Indentation is used only if the braces of a file do not match.
    """

    def __init__(self, source: Source, tokens: Tokens, problems: Diagnostics) -> None:
        self.source = source
        self._tokens = tokens
        self._problems = problems
        self._kinds = tokens.kinds
        self._texts = tokens.texts
        self._at = 0
        self._open: list[_Open] = []
        self._guided = not _braces_match(tokens) and _is_laid_out(source, tokens)
        self._too_deep = False
        self._last_end = -1  # of the last field

    def document(self) -> list[Field]:
        """Parses a whole text."""
        fields = self._fields()
        cut = self._tokens.cut_at
        if cut is None:
            self._report_open_blocks()
        else:
            message = f"{self.source.name} contains more than {MAX_TOKENS} words and signs"
            self._error(
                "file-too-large", f"{message}; a configuration is never that long.", cut, cut + 1, found=""
            )
        return fields

    def value_only(self) -> Field:
        """Parses a text with one value, for a known field."""
        field = Field("", self._start, self._start)
        field.has_colon = True
        self._value(field)
        field.end = self._last_end = self._tokens.ends[max(self._at - 1, 0)]
        if self._kind != END:
            self._error(
                "unexpected-text", f"Unexpected '{self._run_text()}' after the value.", end=self._run_end()
            )
        self._report_open_blocks()
        return field

    # The cursor

    @property
    def _kind(self) -> int:
        return self._kinds[self._at]

    @property
    def _text(self) -> str:
        return self._texts[self._at]

    @property
    def _start(self) -> int:
        return self._tokens.starts[self._at]

    @property
    def _end(self) -> int:
        return self._tokens.ends[self._at]

    @property
    def _end_before(self) -> int:
        """Offset after the token before the cursor."""
        return self._tokens.ends[self._at - 1]

    def _is(self, signs: str) -> bool:
        """Whether one of some signs is at the cursor."""
        return self._kind == SIGN and self._text in signs

    def _precedes(self, signs: str) -> bool:
        """Whether one of some signs follows the token at the cursor."""
        return self._kinds[self._at + 1] == SIGN and self._texts[self._at + 1] in signs

    def _run_text(self) -> str:
        """The text from the cursor to white space or a sign that ends values, shortened."""
        return shortened(self.source.text[self._start : self._run_end()])

    def _run_end(self, start: int | None = None) -> int:
        """Offset of the end of that text, or of one with another start."""
        stop = _RUN_END.search(self.source.text, (self._start if start is None else start) + 1)
        return stop.start() if stop is not None else len(self.source.text)

    def _span(self, start: int, end: int) -> Span:
        return Span(self.source, start, end)

    def _error(
        self, code: str, message: str, start: int | None = None, end: int | None = None, **details: Any
    ) -> None:
        """Reports an error, by default at the cursor's token."""
        place = self._span(self._start if start is None else start, self._end if end is None else end)
        self._problems.error(code, message, place, **details)

    # Fields

    def _fields(self) -> list[Field]:
        """Parses fields to the end of the innermost open block, or of the text."""
        found: list[Field] = []
        while not self._problems.full:
            kind = self._kind
            field: Field | None = None
            if kind == END:
                break
            if kind == NAME or (kind == NUMBER and self._precedes(":{")):
                if self._is_outside_block():
                    self._report_unclosed(self._open.pop(), self._start)
                    break
                field = self._field()
            elif self._is("}>"):
                if self._closes_block():
                    break
            elif self._is("["):
                field = self._type_field()
            else:
                self._unexpected()
            if field is not None:
                found.append(field)
                if self._is(",;"):
                    field.separator = self._text
                    self._at += 1
        return found

    def _field(self) -> Field | None:
        field = Field(self._text, self._start, self._end)
        follows_value = self._at > 0 and self._end_before == self._last_end
        self._at += 1
        if follows_value and self._is_stray_word(field):
            return None
        return self._rest_of_field(field)

    def _is_stray_word(self, field: Field) -> bool:
        """Reports a word after a value on its line that begins no field."""
        line = self.source.line(field.name_start)
        if self.source.line(self._last_end - 1) != line or self._is(":{<["):
            return False
        if self._kind in (STRING, NUMBER) or (self._kind == OTHER and self._text == "="):
            return False
        end = self._run_end(field.name_start)
        self._error(
            "unexpected-text",
            f"Unexpected '{self.source.text[field.name_start : end]}' after a value.",
            field.name_start,
            end,
            remedy="Put text of several words in double quotes. Start a new field on a new line.",
        )
        self._skip_rest_of(line)
        return True

    def _type_field(self) -> Field | None:
        """Parses a field named by a type in square brackets."""
        start = self._start
        parts: list[str] = []
        self._at += 1
        while not self._is("]"):
            if self._kind in (END, STRING, OPEN_STRING) or self._is("{}<>[:"):
                message = "The type name has no closing ]."
                self._error("bad-type-name", message, start, self._end_before)
                self._skip_rest_of(self.source.line(start))
                return None
            parts.append(self._text)
            self._at += 1
        field = Field("".join(parts), start, self._end, is_type=True)
        self._at += 1
        return self._rest_of_field(field)

    def _rest_of_field(self, field: Field) -> Field:
        if self._is(":"):
            field.has_colon = True
            self._at += 1
        elif self._kind == OTHER and self._text == "=":
            message = f"{field.name} is followed by '='. The text format uses a colon."
            self._error("missing-colon", message, allowed=(":",), remedy=f"Write `{field.name}: …`.")
            field.has_colon = True
            self._at += 1
        self._value(field)
        field.end = self._last_end = max(self._end_before, field.name_end)
        return field

    def _value(self, field: Field) -> None:
        if self._is("{<"):
            field.value = self._block(field.name)
        elif self._is("["):
            field.value = self._list(field)
        elif field.has_colon:
            begins_field = self._kind in (NAME, NUMBER) and self._precedes(":{<")
            if begins_field and self.source.is_first_on_line(self._start):
                self._missing_value_or_brace(field)
            elif self._kind in (END, SIGN):
                self._missing_value(field)
            else:
                field.value = self._scalar(field.name)
        elif self._kind not in (END, SIGN) and (
            self.source.line(self._start) == self.source.line(field.name_start)
        ):
            self._of_name(field, "missing-colon", "A colon is missing after {}.", "Write `{}: …`.")
            field.value = self._scalar(field.name)
        else:
            self._missing_value_or_brace(field)

    def _missing_value_or_brace(self, field: Field) -> None:
        """Treats lines indented below a name as its block with a missing brace."""
        if self._kind == NAME and self.source.column(self._start) > self.source.column(field.name_start):
            self._of_name(field, "missing-brace", "{{ is missing after {}.", "Write `{} {{`.")
            field.value = self._block(field.name, opened_at=field.name_start)
        else:
            self._missing_value(field)

    def _missing_value(self, field: Field) -> None:
        if field.name:
            remedy = "Write `{}: …` or delete the name."
            self._of_name(field, "missing-value", "{} has no value.", remedy)
        else:
            self._of_name(field, "missing-value", "The option has no value.", "")

    def _of_name(self, field: Field, code: str, message: str, remedy: str) -> None:
        """Reports an error at the name of a field, which replaces ``{}`` in the texts."""
        texts = message.format(field.name), field.name_start, field.name_end
        self._error(code, *texts, found=field.name, remedy=remedy.format(field.name))

    def _unexpected(self) -> None:
        """Reports text that cannot begin a field, and continues at the next line or after its block."""
        start, end = self._start, self._run_end()
        text = self.source.text[start:end]
        remedy = ""
        if text.startswith("//"):
            remedy = "Begin a comment with #."
        elif self._kind == NUMBER and self.source.text[start - 1 : start] == ",":
            remedy = "Write decimal fractions with a point, and lists in square brackets."
        self._error("unexpected-text", f"Expected a field, found '{text}'.", end=end, remedy=remedy)
        self._skip_rest_of(self.source.line(start))

    def _skip_rest_of(self, line: int) -> None:
        """Skips the tokens of a line, including a block that begins on it."""
        while self._kind != END and self.source.line(self._start) == line:
            if self._open and self._is("}>"):
                return
            if self._is("{"):
                self._block("the block")
                return
            self._at += 1

    # Blocks

    def _block(self, name: str, opened_at: int | None = None) -> Block:
        """Parses a block. ``opened_at`` replaces a missing opening brace."""
        start = self._start if opened_at is None else opened_at
        closer = _CLOSER.get(self._text, "}") if opened_at is None else "}"
        brace = self._span(start, self._end)
        if opened_at is None:
            self._at += 1
        if len(self._open) >= MAX_DEPTH:
            self._skip_deep_block(brace)
            return Block(start, self._end_before, [])
        line, indentation = self.source.line(start), self.source.indentation(start)
        self._open.append(_Open(name, brace, closer, line, indentation, opened_at is not None))
        fields = self._fields()
        return Block(start, self._end_before, fields)

    def _skip_deep_block(self, brace: Span) -> None:
        if not self._too_deep:
            self._too_deep = True
            message = f"Blocks are nested more than {MAX_DEPTH} deep."
            self._problems.error("nesting-too-deep", message, brace)
        depth = 1
        while self._kind != END and depth:
            depth += self._is("{<") - self._is("}>")
            self._at += 1

    def _closes_block(self) -> bool:
        """Handles a closing brace. True if it ends the innermost open block."""
        if not self._open:
            remedy = "Delete it, or look above for a block that is closed too early."
            self._error("stray-closer", f"'{self._text}' closes nothing.", remedy=remedy)
            self._at += 1
            return False
        block = self._open[-1]
        related = [(block.brace, f"{block.name} is opened here")]
        if self._guided and self.source.is_first_on_line(self._start):
            column = self.source.column(self._start)
            if column > block.indentation and self.source.line(self._start) > block.line:
                message = f"'{self._text}' closes nothing: the block {block.name} continues below."
                self._error("stray-closer", message, remedy="Delete it.", related=related)
                self._at += 1
                return False
            if any(outer.indentation == column < block.indentation for outer in self._open):
                self._report_unclosed(self._open.pop(), self._start)
                return True
        if self._text != block.closer:
            self._error(
                "mismatched-closer",
                f"'{self._text}' does not match the bracket that opened the block.",
                allowed=(block.closer,),
                remedy=f"Write '{block.closer}'.",
                related=related,
            )
        self._open.pop()
        self._at += 1
        return True

    def _is_outside_block(self) -> bool:
        """Whether a field on a separate line is indented outside the innermost open block."""
        if not self._open or not (self._guided or self._open[-1].is_assumed):
            return False
        if not self.source.is_first_on_line(self._start):
            return False
        block = self._open[-1]
        column = self.source.column(self._start)
        return self.source.line(self._start) > block.line and column <= block.indentation

    def _report_open_blocks(self) -> None:
        """Reports blocks that are still open at the end of the text."""
        for block in reversed(self._open):
            self._report_unclosed(block, self._tokens.starts[-1])

    def _report_unclosed(self, block: _Open, before: int) -> None:
        if block.is_assumed:
            return
        where = "the end of the file" if before >= len(self.source.text.rstrip()) else "this line"
        self._problems.error(
            "unclosed-block",
            f"The block {block.name} is not closed.",
            block.brace,
            remedy=f"Add '{block.closer}' where {block.name} ends.",
            related=[(self._span(before, before + 1), f"it must be closed before {where}")],
        )

    # Scalars and lists

    def _scalar(self, name: str) -> Scalar:
        """Parses a scalar. Unquoted text is reported and becomes one broken scalar."""
        start = self._start
        if self._kind in (STRING, OPEN_STRING):
            return self._string()
        # Whether a non-word character follows without white space.
        goes_on = self._kinds[self._at + 1] == OTHER and self._tokens.starts[self._at + 1] == self._end
        if self._kind in _KINDS and not goes_on:
            scalar = Scalar(_KINDS[self._kind], start, self._end, [self._text], [(start, self._end)])
            self._at += 1
            return scalar
        return self._unquoted(name)

    def _string(self) -> Scalar:
        start = self._start
        texts: list[str] = []
        parts: list[tuple[int, int]] = []
        while self._kind == STRING:
            texts.append(self._text)
            parts.append((self._start, self._end))
            self._at += 1
        if self._kind != OPEN_STRING:
            return Scalar(ScalarKind.STRING, start, parts[-1][1], texts, parts)
        remedy = f"Add {self._text[0]} at its end; write a line break inside a string as \\n."
        self._error("unclosed-string", "The string is not closed on its line.", remedy=remedy)
        self._at += 1
        return Scalar(ScalarKind.BROKEN, start, self._end_before, [], [])

    def _unquoted(self, name: str) -> Scalar:
        start = self._start
        end = self._run_end()
        message = f"The value of {name} is not a number, a name or a quoted string."
        if self._text[0] in _CURLY_QUOTES:
            end = self._curly_end(end)
            message = f"The value of {name} is in typographic quotes."
        bare = shortened(self.source.text[start:end].strip(_CURLY_QUOTES))
        remedy = "Put a text value in straight double quotes."
        self._error("unquoted-string", message, start, end, allowed=(f'"{bare}"',), remedy=remedy)
        while self._kind != END and self._start < end:
            self._at += 1
        return Scalar(ScalarKind.BROKEN, start, end, [], [])

    def _curly_end(self, end: int) -> int:
        """Finds the closing typographic quote on the line, so the words between cause no further errors."""
        furthest = self._start + _LONGEST_QUOTED
        line_end = self.source.text.find("\n", self._start, furthest)
        stop = furthest if line_end == -1 else line_end
        closers = [self.source.text.rfind(quote, self._start + 1, stop) for quote in _CURLY_QUOTES]
        return max(end, max(closers) + 1)

    def _list(self, field: Field) -> ListValue:
        """Parses a list of scalars or blocks."""
        result = ListValue(self._start, self._end)
        self._at += 1
        if self._is("]"):
            self._at += 1
        else:
            self._items(result, field)
        result.end = self._end_before
        return result

    def _items(self, result: ListValue, field: Field) -> None:
        lacks_comma = False
        while not self._problems.full:
            if self._is("{<"):
                result.items.append(self._block(field.name))
            elif self._kind in (END, SIGN) or self._begins_field():
                if not self._missing_item(result):
                    return
                continue
            else:
                result.items.append(self._scalar(field.name))
            if self._is("]"):
                self._at += 1
                return
            if self._is(",;"):
                if self._text == ";":
                    self._error(
                        "missing-comma",
                        "A list separates its entries with commas, not with ';'.",
                        allowed=(",",),
                    )
                self._at += 1
                if self._is("]"):
                    self._extra_comma(self._at - 1)
                    self._at += 1
                    return
            elif self._begins_item() and not lacks_comma:  # usually all commas of a list are missing
                lacks_comma = True
                message = f"A comma is missing before '{self._run_text()}'."
                before = self._end_before
                self._error("missing-comma", message, before, before + 1, found="", allowed=(",",))

    def _missing_item(self, result: ListValue) -> bool:
        """Reports a missing entry. False if the list ends there."""
        goes_on = self._is(",[")
        if self._is(","):
            self._extra_comma(self._at)
        elif self._is("["):
            remedy = "Write all entries in one list."
            self._error("unexpected-text", "A list cannot contain a list.", remedy=remedy)
        elif not self._is("]"):
            opened = result.start, result.start + 1
            self._error("unclosed-list", "The list is not closed.", *opened, allowed=("]",))
            return False
        after_comma = self._is(",")
        self._at += 1
        if after_comma and self._is("]"):
            self._at += 1
            return False
        return goes_on

    def _extra_comma(self, at: int) -> None:
        ends = self._tokens.starts[at], self._tokens.ends[at]
        self._error("extra-comma", "No entry follows this comma.", *ends)

    def _begins_item(self) -> bool:
        if self._kind == SIGN:
            return self._text in "{<"
        return self._kind in (NAME, NUMBER, STRING, OTHER) and not self._begins_field()

    def _begins_field(self) -> bool:
        return self._kind == NAME and self._precedes(":{") and self.source.is_first_on_line(self._start)


def parse(source: Source, problems: Diagnostics) -> list[Field]:
    """Parse a text into its top-level fields. Errors go to ``problems``."""
    return Parser(source, tokenize(source), problems).document()


def _braces_match(tokens: Tokens) -> bool:
    open_signs: list[str] = []
    for kind, text in zip(tokens.kinds, tokens.texts, strict=True):
        if kind != SIGN:
            continue
        if text in "{<[":
            open_signs.append(text)
        elif text in _PARTNER and (not open_signs or open_signs.pop() != _PARTNER[text]):
            return False
    return not open_signs


def _is_laid_out(source: Source, tokens: Tokens) -> bool:
    """Whether enough lines inside blocks are indented more than the line of the outermost open block."""
    indented = lines = 0
    openers: list[int] = []
    last_line = 0
    for kind, start, text in zip(tokens.kinds, tokens.starts, tokens.texts, strict=True):
        line = source.line(start)
        if kind == NAME and line != last_line and openers:
            lines += 1
            indented += source.column(start) > openers[0]
        last_line = line
        if kind == SIGN and text in "{<":
            openers.append(source.indentation(start))
        elif kind == SIGN and text in "}>" and openers:
            openers.pop()
    return lines > 0 and indented >= _LAID_OUT * lines
