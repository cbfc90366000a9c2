"""Where blocks begin and end, also when a brace is missing or one too many."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from joshua.textproto.diagnostics import Span
from joshua.textproto.lexer import END, NAME, SIGN
from joshua.textproto.limits import MAX_DEPTH
from joshua.textproto.syntax import Block
from joshua.textproto.value_parser import ValueParser

if TYPE_CHECKING:
    from joshua.textproto.diagnostics import Diagnostics
    from joshua.textproto.lexer import Tokens
    from joshua.textproto.source import Source
    from joshua.textproto.syntax import Field

_CLOSER = {"{": "}", "<": ">"}
_PARTNER = {"}": "{", ">": "<", "]": "["}
# Below this share of indented lines the layout of a file says nothing about its blocks.
_LAID_OUT = 0.5


class _Open(NamedTuple):
    """A block that is being read: its name and opening brace, and the layout of that line.

    Attributes:
        is_assumed: whether its opening brace is missing, so that its indentation alone bounds it.
    """

    name: str
    start: int
    end: int
    closer: str
    line: int
    indentation: int
    is_assumed: bool


class BlockParser(ValueParser):
    """Keeps the blocks that are open; indentation decides only where the braces of a file do not match."""

    def __init__(self, source: Source, tokens: Tokens, problems: Diagnostics) -> None:
        super().__init__(source, tokens, problems)
        self._open: list[_Open] = []
        self._guided = _indentation_must_guide(source, tokens)
        self._too_deep = False

    def fields(self) -> list[Field]:
        """Parses the fields of the block that is open last; the parser of fields implements it."""
        raise NotImplementedError

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
        self._open.append(_Open(name, start, end, closer, line, indentation, opened_at is not None))
        fields = self.fields()
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

    def closes_block(self) -> bool:
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

    def is_outside_block(self) -> bool:
        """Whether a field on a line of its own is not indented as part of the block that is open last."""
        if not self._open or not (self._guided or self._open[-1].is_assumed):
            return False
        if not self.source.is_first_on_line(self.start):
            return False
        block = self._open[-1]
        column = self.source.column(self.start)
        return self.source.line(self.start) > block.line and column <= block.indentation

    def leave_block(self) -> None:
        """Reports the block that is open last as not closed, and leaves it."""
        self._report_unclosed(self._open.pop(), self.start)

    def report_open_blocks(self) -> None:
        """Reports the blocks that are open at the end of the text."""
        for block in reversed(self._open):
            self._report_unclosed(block, self.tokens.starts[-1])

    def _report_unclosed(self, block: _Open, before: int) -> None:
        if block.is_assumed:
            return
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


def _indentation_must_guide(source: Source, tokens: Tokens) -> bool:
    """Tells whether braces do not match while the file is indented well enough to find the faulty ones."""
    return not _braces_match(tokens) and _is_laid_out(source, tokens)


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
    """Counts the lines inside blocks that stand further right than the line of the outermost open block."""
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
