"""Our reader against ``google.protobuf.text_format``: the same message for every text."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from config_texts import config_texts, damaged_texts
from google.protobuf import text_format
from hypothesis import HealthCheck, given, settings
from joshua.config import LoadedConfig, load
from joshua.plan import Diagnostic, Severity
from joshua.schema.config_pb2 import Config
from third_party import URL, sample_class

# Texts that text_format accepts and the reader refuses on purpose.
STRICTER = {
    "duplicate-field",  # a second 0 goes unnoticed there
    "unknown-enum-number",  # open enums keep any number there
    "bad-escape",  # an unknown escape is kept as it stands there
    "mixed-any",  # the last type of a block wins there
    "include-missing",
    "include-cycle",
    "not-a-file",
    "file-unreadable",
    "include-twice",
}
QUICK = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)


@pytest.fixture(scope="module")
def folder() -> Iterator[Path]:
    with TemporaryDirectory() as name:
        yield Path(name)


def read(folder: Path, text: str) -> LoadedConfig:
    path = folder / "robot.pbtxt"
    path.write_bytes(text.encode())
    return load(path, message_types=[sample_class()])


def reference(text: str) -> Any:
    """What text_format reads, or the error that it raises."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # it keeps unknown escapes
            return text_format.Parse(text, Config())
    # text_format lets errors of its number and string conversions through.
    except (text_format.ParseError, UnicodeError, ValueError) as fault:
        return fault


def same(one: Config, other: Config) -> bool:
    """Equality that holds for NaN too."""
    return one.SerializeToString(deterministic=True) == other.SerializeToString(deterministic=True) or str(
        one
    ) == str(other)


def errors_of(loaded: LoadedConfig) -> list[Diagnostic]:
    """The errors of a load; a note, as on octal numbers, leaves the value as it is."""
    return [item for item in loaded.diagnostics if item.severity is Severity.ERROR]


@QUICK
@given(text=config_texts())
def test_every_spelling_gives_the_same_message(folder: Path, text: str) -> None:
    wanted = reference(text)
    loaded = read(folder, text)
    if isinstance(wanted, Exception):
        assert errors_of(loaded), wanted
    else:
        assert [item for item in errors_of(loaded) if item.code not in STRICTER] == []
        assert errors_of(loaded) or same(loaded.config, wanted)


@QUICK
@given(text=damaged_texts())
def test_damaged_texts_are_accepted_only_with_the_same_meaning(folder: Path, text: str) -> None:
    wanted = reference(text)
    loaded = read(folder, text)
    if not errors_of(loaded):
        assert not isinstance(wanted, Exception), wanted
        assert same(loaded.config, wanted)
    elif not isinstance(wanted, Exception):
        assert {item.code for item in errors_of(loaded)} & STRICTER, errors_of(loaded)


def wrapped(body: str) -> str:
    return f"simulation {{ plugin_config {{ [{URL}] {{ {body} }} }} }}"


@pytest.mark.parametrize(
    "body",
    [
        "f_int32: 0x7fffffff f_sint64: -0x8000000000000000 f_uint64: 01777777777777777777777",
        "many_f_int32: [0, -017, 0X1f] many_f_int32: 5, many_f_int32: []; many_f_int32 : [6]",
        "f_float: 1.5f f_double: -inf many_f_float: [inf, nan, -Infinity, 1e400, 3.5F, .5, 5., 1e39]",
        "f_bool: t many_f_bool: [true, false, True, False, 1, 0, f]",
        "f_string: 'a' \"b\"\n'c' # comment\n'd' f_bytes: '\\xff\\377\\0'",
        r"f_string: '\a\b\f\n\r\t\v\\\'\"' many_f_string: ['\101', '\x41', '\u00e9', '\U0001F600', '\x9']",
        "color: 2 colors: [RED, GREEN, 0, 0x1]",
        "inner < f_int32: 1; >, inners: { } inners < >",
        "inners [ { f_int32: 1 }, < f_int32: 2 > ] inners: [] inners: [{}]",
        "counts { key: 'a' value: 1 } counts: [{ value: 2 }, { key: 'a' value: 3 }]",
        "parts { key: 'a' value { f_int32: 1 } } parts { key: 'a' value < f_bool: true > }",
        f"anything {{ [{URL}] {{ anything: < [ {URL.replace('/', ' / ')} ] : < left: 3 > > }} }}",
        "left: 0 maybe: 0",
        "f_int32: 1_000 f_int64: +5 f_float: 1_0.5",
    ],
)
def test_literal_forms(folder: Path, body: str) -> None:
    text = wrapped(body)
    loaded = read(folder, text)
    assert errors_of(loaded) == []
    assert same(loaded.config, text_format.Parse(text, Config()))


def test_a_raw_any_block_is_kept(folder: Path) -> None:
    text = f'simulation {{ plugin_config {{ type_url: "{URL}" value: "\\x28\\x05" }} }}'
    loaded = read(folder, text)
    assert loaded.diagnostics == []
    assert loaded.config == text_format.Parse(text, Config())


def test_a_byte_order_mark_is_no_part_of_the_text(folder: Path) -> None:
    loaded = read(folder, "\ufeffgeneral { name: 'x' }")
    assert loaded.diagnostics == []
    assert loaded.config.general.name == "x"
    place = loaded.positions.name("general")
    assert place is not None
    assert place.column == 1


def test_the_example_of_the_specification_is_read(folder: Path) -> None:
    text = (Path(__file__).parent / "good" / "specification_example.pbtxt").read_text(encoding="utf-8")
    loaded = read(folder, text)
    assert loaded.diagnostics == []
    assert loaded.config == text_format.Parse(text, Config())
