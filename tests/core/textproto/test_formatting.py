"""The layout of ``joshua fmt``: examples, and what holds for every text."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from config_texts import config_texts, damaged_texts
from google.protobuf import text_format
from hypothesis import HealthCheck, given, settings
from joshua.config.format_file import format_bytes
from joshua.schema.config_pb2 import Config
from joshua.textproto.lexer import tokenize
from joshua.textproto.source import Source

CONFIGS = sorted((Path(__file__).parents[3] / "configs").glob("*.pbtxt"))
QUICK = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)


def formatted(text: str) -> str:
    result = format_bytes("robot.pbtxt", text.encode())
    assert result.diagnostics == []
    assert result.text is not None
    assert result.is_changed == (result.text != text)
    again = format_bytes("robot.pbtxt", result.text.encode())
    assert again.text == result.text
    return result.text


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("", ""),
        ("\n\n", ""),
        ("# only a comment", "# only a comment\n"),
        ("a:1", "a: 1\n"),
        ("a :   1 ;b:2,c:3", "a: 1\nb: 2\nc: 3\n"),
        ("a{b:1}", "a { b: 1 }\n"),
        ("a: <\nb: 1 >", "a {\n  b: 1\n}\n"),
        ("a { }", "a {}\n"),
        ("a {\n}", "a {}\n"),
        ("a {\n\n  b: 1\n\n\n\n  c: 2\n\n}\n", "a {\n  b: 1\n\n  c: 2\n}\n"),
        ("\n\na: 1\n\n\nb: 2\n\n", "a: 1\n\nb: 2\n"),
        ("# head\n\n\n# lead\na: 1 # trail  \n# end", "# head\n\n# lead\na: 1  # trail\n# end\n"),
        ("a: 1, # after a comma", "a: 1  # after a comma\n"),
        ("a: 1 # before a comma\n,b: 2", "a: 1  # before a comma\nb: 2\n"),
        ("a { # open\n b: 1 # b\n # last\n} # close", "a {  # open\n  b: 1  # b\n  # last\n}  # close\n"),
        ("a { b: 1 # b\n}", "a {\n  b: 1  # b\n}\n"),
        ("a # one\n{ b: 1 }", "# one\na { b: 1 }\n"),
        ("a # one\n: # two\n1 # three", "# one\n# two\na: 1  # three\n"),
        ("a {\n# nothing\n}", "a {\n  # nothing\n}\n"),
        ("ids: [ 1,2 ,\n 3 ]", "ids: [1, 2, 3]\n"),
        ("ids: []", "ids: []\n"),
        ("ids: [ # open\n1, # one\n# two\n2 # last\n# end\n] # close",
         "ids: [  # open\n  1,  # one\n  # two\n  2  # last\n  # end\n]  # close\n"),
        ("bs: [{a:1}, {}]", "bs: [{ a: 1 }, {}]\n"),
        ("bs [{a:1\n}, < b: 2\n c: 3 >]", "bs: [\n  {\n    a: 1\n  },\n  {\n    b: 2\n    c: 3\n  }\n]\n"),
        ("s: 'a'  \"b\"", "s: 'a' \"b\"\n"),
        ("s: 'a'\n  'b' # c\n", "s:\n  'a'\n  'b'  # c\n"),
        ("x { [ a.b / acme.T ] : { f: 0x1F } }", "x { [a.b/acme.T] { f: 0x1F } }\n"),
        ("a:1\r\nb{\r\n\tc:2\r\n}\r\n", "a: 1\nb {\n  c: 2\n}\n"),
        ("\ufeffa: 1\n", "a: 1\n"),
        ("a { b { c: 1 } d: [1,2] }", "a { b { c: 1 } d: [1, 2] }\n"),
        ("a {\n  b: 1 }  # c\nd: 1", "a {\n  b: 1\n}  # c\nd: 1\n"),
    ],
)  # fmt: skip
def test_examples(text: str, wanted: str) -> None:
    result = format_bytes("robot.pbtxt", text.encode())
    assert result.text == wanted
    again = format_bytes("robot.pbtxt", wanted.encode())
    assert again.text == wanted
    assert not again.is_changed


def test_a_block_that_does_not_fit_on_a_line_is_spread() -> None:
    words = " ".join(f"field_number_{number}: {number}" for number in range(6))
    assert formatted(f"a {{ {words} }}").splitlines()[:3] == [
        "a {",
        "  field_number_0: 0",
        "  field_number_1: 1",
    ]


def test_a_list_that_does_not_fit_on_a_line_is_spread() -> None:
    items = [f'"item number {number}"' for number in range(8)]
    lines = formatted(f"names: [{', '.join(items)}]").splitlines()
    assert lines == ["names: [", *(f"  {item}," for item in items[:-1]), f"  {items[-1]}", "]"]


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.name)
def test_the_presets_are_formatted(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert formatted(text) == text


def comments(text: str) -> Counter[str]:
    source = Source("", text.replace("\r\n", "\n"))
    return Counter(source.text[start:end].rstrip() for start, end in tokenize(source).comments)


# Protobuf's own parser, whose reading is compared, warns about a backslash that is written as \\u005c.
@pytest.mark.filterwarnings("ignore:invalid escape sequence:DeprecationWarning")
@QUICK
@given(text=config_texts())
def test_every_text_keeps_its_meaning_and_comments(text: str) -> None:
    result = format_bytes("robot.pbtxt", text.encode())
    if result.text is None:
        with pytest.raises((text_format.ParseError, UnicodeError, ValueError)):
            text_format.Parse(text, Config())
        return
    assert comments(result.text) == comments(text)
    again = format_bytes("robot.pbtxt", result.text.encode())
    assert again.text == result.text
    assert not again.is_changed
    try:
        wanted = text_format.Parse(text, Config())
    except (text_format.ParseError, UnicodeError, ValueError):
        return  # syntax alone is asked for here
    assert str(text_format.Parse(result.text, Config())) == str(wanted)


@QUICK
@given(text=damaged_texts())
def test_a_damaged_text_is_formatted_without_harm_or_refused(text: str) -> None:
    result = format_bytes("robot.pbtxt", text.encode())
    assert (result.text is None) == bool(result.diagnostics)
    assert "format-refused" not in {item.code for item in result.diagnostics}
    if result.text is not None:
        assert comments(result.text) == comments(text.removeprefix("\ufeff"))
        assert format_bytes("robot.pbtxt", result.text.encode()).text == result.text
