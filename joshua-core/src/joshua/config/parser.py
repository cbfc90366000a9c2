"""Tokens to a syntax tree; after an error it goes on at the next field, so that one run finds all errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from joshua.config.brackets import indentation_must_guide
from joshua.config.lexer import END, NAME, NUMBER, OPEN_STRING, OTHER, SIGN, STRING, tokenize
from joshua.config.limits import MAX_DEPTH, MAX_TOKENS
from joshua.config.problems import Span
from joshua.config.syntax import Block, Field, ListValue, Scalar
from joshua.config.value_parser import ValueParser

if TYPE_CHECKING:
    from joshua.config.lexer import Tokens
    from joshua.config.problems import Problems
    from joshua.config.source import Source

_CLOSER = {"{": "}", "<": ">"}


@dataclass(slots=True)
class _Open:
    """A block that is being read: its name and opening brace, and the layout of that line."""

    name: str
    start: int
    end: int
    closer: str
    line: int
    indentation: int


class Parser(ValueParser):
    """Parses one text; every error goes to ``problems``."""

    def __init__(self, source: Source, tokens: Tokens, problems: Problems) -> None:
        super().__init__(source, tokens, problems)
        self._open: list[_Open] = []
        self._guided = indentation_must_guide(source, tokens)
        self._too_deep = False
        self._last_end = -1

    def document(self) -> list[Field]:
        """Parses a whole text."""
        fields = self._body()
        if self.tokens.cut_at is not None:
            self.error(
                "file-too-large",
                f"{self.source.name} holds more than {MAX_TOKENS} words and signs; "
                "a configuration is never that long.",
                self.tokens.cut_at,
                self.tokens.cut_at + 1,
            )
        else:
            for block in reversed(self._open):
                self._report_unclosed(block, self.tokens.starts[-1])
        return fields

    def value_only(self) -> Field:
        """Parses a text that is one value, for a field whose name is known."""
        field = Field("", self.start, self.start, has_colon=True)
        self._value(field)
        field.end = self._last_end = self.tokens.ends[max(self.at - 1, 0)]
        if self.kind != END:
            self.error(
                "unexpected-text", f"'{self.run_text()}' stands after the value.", self.start, self.run_end()
            )
        for block in reversed(self._open):
            self._report_unclosed(block, self.tokens.starts[-1])
        return field

    def _body(self) -> list[Field]:
        """Parses fields up to the end of the block that is open last, or of the text."""
        fields: list[Field] = []
        while not self.problems.full:
            kind = self.kind
            if kind == END:
                break
            if kind == NAME or (kind == NUMBER and self._number_names_a_field()):
                if self._guided and self._is_outside_block():
                    self._report_unclosed(self._open.pop(), self.start)
                    break
                fields.append(self._field())
                self._separator(fields[-1])
            elif kind == SIGN and self.text in "}>":
                if self._closes_block():
                    break
            elif kind == SIGN and self.text == "[":
                field = self._type_field()
                if field is not None:
                    fields.append(field)
                    self._separator(field)
            else:
                self._unexpected()
        return fields

    def _number_names_a_field(self) -> bool:
        return self.kinds[self.at + 1] == SIGN and self.texts[self.at + 1] in ":{"

    def _field(self) -> Field:
        field = Field(self.text, self.start, self.end)
        self.at += 1
        self._rest_of_field(field)
        return field

    def _type_field(self) -> Field | None:
        """Parses a field whose name is a type in square brackets."""
        start = self.start
        line = self.source.line(start)
        parts: list[str] = []
        self.at += 1
        while not (self.kind == SIGN and self.text == "]"):
            if self.kind in (END, STRING, OPEN_STRING) or (self.kind == SIGN and self.text in "{}<>[:"):
                end = self.tokens.ends[self.at - 1]
                self.error(
                    "bad-type-name",
                    "The type name that [ opens is not closed by ].",
                    start,
                    end,
                    found=self.source.text[start:end],
                )
                self._skip_rest_of(line)
                return None
            parts.append(self.text)
            self.at += 1
        field = Field("".join(parts), start, self.end, is_type=True)
        self.at += 1
        self._rest_of_field(field)
        return field

    def _rest_of_field(self, field: Field) -> None:
        if self.kind == SIGN and self.text == ":":
            field.has_colon = True
            self.at += 1
        elif self.kind == OTHER and self.text == "=":
            self.error(
                "missing-colon",
                f"'=' stands between {field.name} and its value; the text format takes a colon.",
                self.start,
                self.end,
                found="=",
                allowed=(":",),
                remedy=f"Write `{field.name}: …`.",
            )
            field.has_colon = True
            self.at += 1
        self._value(field)
        field.end = self._last_end = max(self.tokens.ends[self.at - 1], field.name_end)

    def _value(self, field: Field) -> None:
        if self.kind == SIGN and self.text in "{<":
            field.value = self.block(field.name)
        elif self.kind == SIGN and self.text == "[":
            field.value = self.list_value(field)
        elif field.has_colon:
            if self._is_next_field() or self.kind in (END, SIGN):
                self._missing_value(field)
            else:
                field.value = self.scalar(field.name)
        else:
            self._value_without_colon(field)

    def _is_next_field(self) -> bool:
        """Whether a field begins here on a line of its own, so that the value before it is missing."""
        if self.kind not in (NAME, NUMBER) or not self.source.is_first_on_line(self.start):
            return False
        return self.kinds[self.at + 1] == SIGN and self.texts[self.at + 1] in ":{<"

    def _missing_value(self, field: Field) -> None:
        self.error(
            "missing-value",
            f"{field.name or 'The option'} has no value.",
            field.name_start,
            field.name_end,
            found=field.name,
            remedy=f"Write `{field.name}: …` or delete the name." if field.name else "",
        )

    def _value_without_colon(self, field: Field) -> None:
        line = self.source.line(field.name_start)
        same_line = self.kind != END and self.source.line(self.start) == line
        if (
            self._last_end >= 0
            and self.source.line(self._last_end) == line
            and not (same_line and self.kind in (STRING, OPEN_STRING))
        ):
            end = self._run_end_from(field.name_start)
            text = self.source.text[field.name_start : end]
            self.error(
                "unexpected-text",
                f"'{text}' stands after a value.",
                field.name_start,
                end,
                found=text,
                remedy="Put a text of several words in double quotes, or start a new line for a new field.",
            )
            self._skip_rest_of(line)
        elif same_line and self.kind in (NAME, NUMBER, STRING, OPEN_STRING, OTHER):
            self.error(
                "missing-colon",
                f"A colon is missing after {field.name}.",
                field.name_start,
                field.name_end,
                found=field.name,
                remedy=f"Write `{field.name}: …`.",
            )
            field.value = self.scalar(field.name)
        elif self.kind == NAME and self.source.column(self.start) > self.source.indentation(field.name_start):
            self.error(
                "missing-brace",
                f"{{ is missing after {field.name}.",
                field.name_start,
                field.name_end,
                found=field.name,
                remedy=f"Write `{field.name} {{`.",
            )
            field.value = self.block(field.name, opened_at=field.name_start)
        else:
            self._missing_value(field)

    def block(self, name: str, opened_at: int | None = None) -> Block:
        """Parses a block; ``opened_at`` stands in for an opening brace that is missing."""
        start = self.start if opened_at is None else opened_at
        closer = _CLOSER.get(self.text, "}") if opened_at is None else "}"
        end = self.end
        if opened_at is None:
            self.at += 1
        if len(self._open) >= MAX_DEPTH:
            self._skip_deep_block(start, end)
            return Block(start, self.tokens.ends[self.at - 1])
        line, indentation = self.source.line(start), self.source.indentation(start)
        self._open.append(_Open(name, start, end, closer, line, indentation))
        fields = self._body()
        return Block(start, self.tokens.ends[self.at - 1], fields)

    def _skip_deep_block(self, start: int, end: int) -> None:
        if not self._too_deep:
            self._too_deep = True
            self.error(
                "nesting-too-deep",
                f"Blocks are nested more than {MAX_DEPTH} deep.",
                start,
                end,
                found=self.source.text[start:end],
            )
        depth = 1
        while self.kind != END and depth:
            if self.kind == SIGN and self.text in "{<":
                depth += 1
            elif self.kind == SIGN and self.text in "}>":
                depth -= 1
            self.at += 1

    def _closes_block(self) -> bool:
        """Handles a closing brace; True where it ends the block that is open last."""
        if not self._open:
            self.error(
                "stray-closer",
                f"'{self.text}' closes nothing.",
                self.start,
                self.end,
                found=self.text,
                remedy="Delete it, or look above for a block that is closed too early.",
            )
            self.at += 1
            return False
        block = self._open[-1]
        if self._guided and self.source.is_first_on_line(self.start):
            column = self.source.column(self.start)
            if column > block.indentation and self.source.line(self.start) > block.line:
                self.error(
                    "stray-closer",
                    f"'{self.text}' closes nothing: {block.name} goes on below.",
                    self.start,
                    self.end,
                    found=self.text,
                    remedy="Delete it.",
                    related=[(Span(self.source, block.start, block.end), f"{block.name} is opened here")],
                )
                self.at += 1
                return False
            if any(outer.indentation == column < block.indentation for outer in self._open):
                self._report_unclosed(self._open.pop(), self.start)
                return True
        if self.text != block.closer:
            self.error(
                "mismatched-closer",
                f"'{self.text}' closes a block that another bracket opened.",
                self.start,
                self.end,
                found=self.text,
                allowed=(block.closer,),
                remedy=f"Write '{block.closer}'.",
                related=[(Span(self.source, block.start, block.end), f"{block.name} is opened here")],
            )
        self._open.pop()
        self.at += 1
        return True

    def _is_outside_block(self) -> bool:
        """Whether a field on a line of its own is not indented as part of the block that is open last."""
        if not self._open or not self.source.is_first_on_line(self.start):
            return False
        block = self._open[-1]
        column = self.source.column(self.start)
        return self.source.line(self.start) > block.line and column <= block.indentation

    def _report_unclosed(self, block: _Open, before: int) -> None:
        where = "the end of the file" if before >= len(self.source.text.rstrip()) else "this line"
        self.error(
            "unclosed-block",
            f"The block {block.name} is not closed.",
            block.start,
            block.end,
            found=self.source.text[block.start : block.end],
            remedy=f"Add '{block.closer}' where {block.name} ends.",
            related=[(Span(self.source, before, before + 1), f"{where} comes before it is closed")],
        )

    def _separator(self, field: Field) -> None:
        if self.kind == SIGN and self.text in ",;":
            field.separator = self.text
            self.at += 1

    def _unexpected(self) -> None:
        """Reports what cannot begin a field and goes on at the next line, or after the block it opens."""
        start, end = self.start, self.run_end()
        text = self.source.text[start:end]
        remedy = ""
        if text.startswith("//"):
            remedy = "Begin a comment with #."
        elif self.kind == NUMBER and self.source.text[start - 1 : start] == ",":
            remedy = "Write decimal fractions with a point, and lists in square brackets."
        self.error(
            "unexpected-text",
            f"'{text}' stands where a field was expected.",
            start,
            end,
            found=text,
            remedy=remedy,
        )
        self._skip_rest_of(self.source.line(start))

    def _skip_rest_of(self, line: int) -> None:
        """Skips the tokens of a line; a block that begins among them is read and dropped."""
        while self.kind != END and self.source.line(self.start) == line:
            if self.kind == SIGN and self.text in "}>" and self._open:
                return
            if self.kind == SIGN and self.text == "{":
                self.block("the block")
                return
            self.at += 1


def parse(source: Source, problems: Problems) -> list[Field]:
    """Parses a text into its top-level fields; what is wrong goes to ``problems``."""
    return Parser(source, tokenize(source), problems).document()


__all__ = ["Block", "Field", "ListValue", "Parser", "Scalar", "parse"]
