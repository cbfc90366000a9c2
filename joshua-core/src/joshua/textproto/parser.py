"""Tokens to a syntax tree; after an error it goes on at the next field, so that one run finds all errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from joshua.textproto.block_parser import BlockParser
from joshua.textproto.lexer import END, NAME, NUMBER, OPEN_STRING, OTHER, SIGN, STRING, tokenize
from joshua.textproto.limits import MAX_TOKENS
from joshua.textproto.syntax import Field

if TYPE_CHECKING:
    from joshua.textproto.diagnostics import Diagnostics
    from joshua.textproto.lexer import Tokens
    from joshua.textproto.source import Source


class Parser(BlockParser):
    """Parses one text; every error goes to ``problems``."""

    def __init__(self, source: Source, tokens: Tokens, problems: Diagnostics) -> None:
        super().__init__(source, tokens, problems)
        self._last_end = -1

    def document(self) -> list[Field]:
        """Parses a whole text."""
        fields = self.fields()
        if self.tokens.cut_at is not None:
            self.error(
                "file-too-large",
                f"{self.source.name} holds more than {MAX_TOKENS} words and signs; "
                "a configuration is never that long.",
                self.tokens.cut_at,
                self.tokens.cut_at + 1,
            )
        else:
            self.report_open_blocks()
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
        self.report_open_blocks()
        return field

    def fields(self) -> list[Field]:
        """Parses fields up to the end of the block that is open last, or of the text."""
        found: list[Field] = []
        while not self.problems.full:
            kind = self.kind
            if kind == END:
                break
            if kind == NAME or (kind == NUMBER and self._number_names_a_field()):
                if self.is_outside_block():
                    self.leave_block()
                    break
                field = self._field()
                if field is not None:
                    found.append(field)
                    self._separator(field)
            elif kind == SIGN and self.text in "}>":
                if self.closes_block():
                    break
            elif kind == SIGN and self.text == "[":
                field = self._type_field()
                if field is not None:
                    found.append(field)
                    self._separator(field)
            else:
                self._unexpected()
        return found

    def _number_names_a_field(self) -> bool:
        return self.kinds[self.at + 1] == SIGN and self.texts[self.at + 1] in ":{"

    def _field(self) -> Field | None:
        field = Field(self.text, self.start, self.end)
        follows_value = self.at > 0 and self.tokens.ends[self.at - 1] == self._last_end
        self.at += 1
        if follows_value and self._is_stray_word(field):
            return None
        self._rest_of_field(field)
        return field

    def _is_stray_word(self, field: Field) -> bool:
        """Reports a word that stands after a value on its line and begins no field."""
        line = self.source.line(field.name_start)
        if self.source.line(self._last_end - 1) != line or (self.kind == SIGN and self.text in ":{<["):
            return False
        if self.kind in (STRING, NUMBER) or (self.kind == OTHER and self.text == "="):
            return False
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
        return True

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
            if self._is_next_field():
                self._missing_value_or_brace(field)
            elif self.kind in (END, SIGN):
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
        if same_line and self.kind in (NAME, NUMBER, STRING, OPEN_STRING, OTHER):
            self.error(
                "missing-colon",
                f"A colon is missing after {field.name}.",
                field.name_start,
                field.name_end,
                found=field.name,
                remedy=f"Write `{field.name}: …`.",
            )
            field.value = self.scalar(field.name)
        else:
            self._missing_value_or_brace(field)

    def _missing_value_or_brace(self, field: Field) -> None:
        """Takes lines that are indented below a name for its block, whose brace is missing."""
        if self.kind == NAME and self.source.column(self.start) > self.source.column(field.name_start):
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


def parse(source: Source, problems: Diagnostics) -> list[Field]:
    """Parses a text into its top-level fields; what is wrong goes to ``problems``."""
    return Parser(source, tokenize(source), problems).document()
