"""Findings as text: layout, carets, width, colours, and hostile characters; findings as JSON."""

from __future__ import annotations

import fcntl
import io
import json
import os
import pty
import struct
import termios
import unicodedata

import pytest
from joshua.config.diagnostics import (
    clean,
    columns_of,
    render_json,
    render_text,
    shorten,
    summary,
    wants_color,
    width,
)
from joshua.plan import Diagnostic, Position, Related, Severity


def finding(line: int = 1, column: int = 1, length: int = 1, **details: object) -> Diagnostic:
    values: dict[str, object] = {
        "code": "out-of-range",
        "severity": Severity.ERROR,
        "message": "fps must be 1 to 1000 Hz",
        "position": Position(file="robot.pbtxt", line=line, column=column, length=length),
    }
    return Diagnostic(**{**values, **details})  # type: ignore[arg-type]


def test_every_part_of_a_finding_is_shown() -> None:
    source = "general {\n  mode: MODE_TSET\n}\n"
    item = finding(
        2,
        9,
        9,
        code="unknown-enum-value",
        message="MODE_TSET is no value of OperationMode",
        field_path="general.mode",
        found="MODE_TSET",
        allowed=("MODE_TEST", "MODE_INFERENCE"),
        remedy="write one of these names",
        related=(Related(position=Position(file="other.pbtxt", line=7, column=3), label="also here"),),
    )
    assert render_text([item], {"robot.pbtxt": source}) == (
        "robot.pbtxt:2:9: error: MODE_TSET is no value of OperationMode\n"
        "  [unknown-enum-value]\n"
        "  field:   general.mode\n"
        "    2 |   mode: MODE_TSET\n"
        "      |         ^^^^^^^^^\n"
        "  found:   MODE_TSET\n"
        "  allowed: MODE_TEST, MODE_INFERENCE\n"
        "  do:      write one of these names\n"
        "  see:     other.pbtxt:7:3: also here\n"
        "\n"
        "1 error in robot.pbtxt\n"
    )


def test_nothing_is_rendered_for_no_findings() -> None:
    assert render_text([], {"robot.pbtxt": ""}) == ""


def test_findings_are_sorted_by_file_then_place_and_the_root_file_comes_first() -> None:
    def at(file: str, line: int, column: int) -> Diagnostic:
        return finding(
            message=f"{file}-{line}-{column}", position=Position(file=file, line=line, column=column)
        )

    items = [at("a.pbtxt", 1, 1), at("robot.pbtxt", 9, 2), at("robot.pbtxt", 9, 1), at("robot.pbtxt", 2, 5)]
    text = render_text(items, {"robot.pbtxt": "", "a.pbtxt": ""})
    heads = [line.split(": ")[0] for line in text.splitlines() if ": error: " in line]
    assert heads == ["robot.pbtxt:2:5", "robot.pbtxt:9:1", "robot.pbtxt:9:2", "a.pbtxt:1:1"]


def test_a_finding_without_a_place_comes_first_and_shows_no_source() -> None:
    items = [finding(), finding(message="the file does not exist", position=None)]
    text = render_text(items, {"robot.pbtxt": "x"})
    assert text.startswith("error: the file does not exist [out-of-range]\n\nrobot.pbtxt:1:1: error:")


@pytest.mark.parametrize(
    ("severities", "expected"),
    [
        ("eee", "3 errors in robot.pbtxt"),
        ("ew", "1 error, 1 warning in robot.pbtxt"),
        ("nwwe", "1 error, 2 warnings, 1 note in robot.pbtxt"),
        ("", "no problems in robot.pbtxt"),
    ],
)
def test_the_summary_counts_by_severity(severities: str, expected: str) -> None:
    by_letter = {severity.value[0]: severity for severity in Severity}
    items = [finding(severity=by_letter[letter]) for letter in severities]
    assert summary(items, {"robot.pbtxt": ""}) == expected


def test_the_summary_names_two_files_and_counts_more() -> None:
    items = [finding(position=Position(file=name, line=1, column=1)) for name in "ab"]
    assert summary(items, {}).endswith(" in a and b")
    items.append(finding(position=Position(file="c", line=1, column=1)))
    assert summary(items, {}).endswith(" in 3 files")


def caret_lines(source: str, column: int, length: int, columns: int = 80) -> tuple[str, str]:
    lines = render_text([finding(1, column, length)], {"robot.pbtxt": source}, columns=columns).splitlines()
    at = next(index for index, line in enumerate(lines) if line.startswith("    1 | "))
    return lines[at][len("    1 | ") :], lines[at + 1][len("      | ") :]


def display(text: str) -> int:
    return sum(2 if unicodedata.east_asian_width(character) in "WF" else 1 for character in text)


def test_the_caret_stands_under_its_span() -> None:
    text, carets = caret_lines('  topic_name: "/a b"', 15, 6)
    assert text == '  topic_name: "/a b"'
    assert carets == " " * 14 + "^" * 6


def test_tabs_are_shown_as_four_columns() -> None:
    text, carets = caret_lines("\t\tfps: 0", 8, 1)
    assert text == "        fps: 0"
    assert carets.index("^") == text.index("0")


def test_wide_characters_take_two_columns() -> None:
    source = 'name: "機械アーム" id: "x y"'
    column = source.index('"x') + 1
    text, carets = caret_lines(source, column, 5)
    assert display(carets[: carets.index("^")]) == display(text[: text.index('"x')])
    _, under = caret_lines(source, source.index("機") + 1, 5)
    assert under.count("^") == 10


def test_combining_characters_take_no_column() -> None:
    source = "na\u0301me: 5"
    text, carets = caret_lines(source, source.index("5") + 1, 1)
    assert text == source
    assert carets.index("^") == len("name: ")


def test_a_long_line_is_cut_around_the_caret_and_fits() -> None:
    source = "x" * 300 + "BAD" + "y" * 300
    text, carets = caret_lines(source, 301, 3)
    assert text.startswith("...")
    assert text.endswith("...")
    assert text[carets.index("^") :].startswith("BAD")
    assert carets.strip() == "^^^"
    assert len("    1 | " + text) <= 80


def test_a_span_that_is_longer_than_the_screen_is_cut() -> None:
    text, carets = caret_lines("a: " + "z" * 500, 4, 500)
    assert len("    1 | " + carets) <= 80
    assert len("    1 | " + text) <= 80
    assert text.startswith("a: zzz")


def test_a_caret_may_stand_one_past_the_end_of_the_line() -> None:
    text, carets = caret_lines("general {", 10, 1)
    assert (text, carets) == ("general {", " " * 9 + "^")


def test_a_place_outside_the_source_shows_no_line() -> None:
    text = render_text([finding(99, 1)], {"robot.pbtxt": "a\n"})
    assert " | " not in text
    assert "^" not in text


def test_control_characters_and_surrogates_cannot_reach_the_terminal() -> None:
    hostile = 'name: "\x1b[2J\x00\x07\x9b31m\u202e\udcff"'
    item = finding(
        1, 7, 5, found=hostile, message=hostile, remedy=hostile, allowed=(hostile,), field_path=hostile
    )
    text = render_text([item], {"robot.pbtxt": hostile})
    text.encode("utf-8")
    assert all(character == "\n" or character.isprintable() or character == " " for character in text)
    assert "␛[2J␀␇" in text


def test_a_carriage_return_at_the_end_of_a_line_is_not_shown() -> None:
    text, _ = caret_lines("fps: 0\r\nx", 6, 1)
    assert text == "fps: 0"


def test_a_huge_found_text_is_cut_to_one_line() -> None:
    text = render_text([finding(found='"' + "q" * 1_000_000 + '"')], {})
    line = next(line for line in text.splitlines() if "found:" in line)
    assert len(line) <= 80
    assert "..." in line


def test_many_allowed_values_are_counted() -> None:
    text = render_text([finding(allowed=tuple(f"V{number}" for number in range(106)))], {})
    assert "V7 and 98 more" in " ".join(text.split())


def test_many_related_places_are_counted() -> None:
    places = tuple(
        Related(position=Position(file="f", line=number, column=1), label="here") for number in range(1, 9)
    )
    text = render_text([finding(related=places)], {})
    assert text.count("  see: ") == 6
    assert "and 3 more places" in text


def test_lines_of_prose_fit_eighty_columns() -> None:
    words = "one node opens a port for itself alone and " * 6
    text = render_text([finding(message=words, remedy=words, allowed=(words,))], {"robot.pbtxt": "x"})
    assert max(len(line) for line in text.splitlines()) <= 80


def test_colour_is_an_option_and_changes_no_character() -> None:
    import re

    sources = {"robot.pbtxt": "fps: 0"}
    plain = render_text([finding(1, 6)], sources)
    coloured = render_text([finding(1, 6)], sources, color=True)
    assert "\x1b[" not in plain
    assert "\x1b[1;31m" in coloured
    assert re.sub(r"\x1b\[[0-9;]*m", "", coloured) == plain


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_colour_is_wanted_only_on_a_terminal_without_no_color() -> None:
    assert wants_color(Terminal(), {"TERM": "xterm"})
    assert wants_color(Terminal(), {"NO_COLOR": ""})
    assert not wants_color(Terminal(), {"NO_COLOR": "1"})
    assert not wants_color(Terminal(), {"TERM": "dumb"})
    assert not wants_color(io.StringIO(), {})


def test_lines_are_made_for_the_terminal() -> None:
    master, slave = pty.openpty()
    with open(slave, "w") as terminal:
        for columns, expected in ((50, 50), (10, 40), (400, 120), (0, 80)):
            fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
            assert columns_of(terminal) == expected
    os.close(master)
    assert columns_of(io.StringIO()) == columns_of(Terminal()) == 80


def test_a_narrow_terminal_gets_narrow_lines() -> None:
    words = "one node opens a port for itself alone and " * 6
    sources = {"robot.pbtxt": f"name: {'x' * 200}"}
    text = render_text([finding(1, 7, message=words, remedy=words, allowed=(words,))], sources, columns=40)
    assert max(len(line) for line in text.splitlines()) <= 40


def test_shorten_keeps_both_ends_and_counts_columns() -> None:
    assert shorten("short", 20) == "short"
    cut = shorten("a" * 30 + "b" * 30, 21)
    assert cut == "a" * 9 + "..." + "b" * 9
    assert width(shorten("機" * 50, 21)) <= 21


def test_clean_leaves_ordinary_text_alone() -> None:
    assert clean("naïve 機械 €") == "naïve 機械 €"


def test_every_attribute_is_there_with_one_based_places() -> None:
    item = Diagnostic(
        code="serial-port-shared",
        severity=Severity.ERROR,
        message="two nodes use one port",
        position=Position(file="robot.pbtxt", line=4, column=7, length=14),
        field_path="robot.actions[1].sts3215_config.comm.serial.port",
        found='"/dev/ttyACM0"',
        allowed=("a", "b"),
        remedy="use another port",
        related=(Related(position=Position(file="arm.pbtxt", line=2, column=1, length=3), label="first"),),
    )
    assert json.loads(render_json([item])) == [
        {
            "code": "serial-port-shared",
            "severity": "error",
            "message": "two nodes use one port",
            "file": "robot.pbtxt",
            "line": 4,
            "column": 7,
            "end_line": 4,
            "end_column": 21,
            "field_path": "robot.actions[1].sts3215_config.comm.serial.port",
            "found": '"/dev/ttyACM0"',
            "allowed": ["a", "b"],
            "remedy": "use another port",
            "related": [
                {
                    "label": "first",
                    "file": "arm.pbtxt",
                    "line": 2,
                    "column": 1,
                    "end_line": 2,
                    "end_column": 4,
                }
            ],
        }
    ]


def test_a_finding_without_a_place_has_nulls() -> None:
    (row,) = json.loads(render_json([Diagnostic(code="c", severity=Severity.NOTE, message="m")]))
    assert [row[key] for key in ("file", "line", "column", "end_line", "end_column")] == [None] * 5
    assert row["severity"] == "note"


def test_no_findings_are_an_empty_list() -> None:
    assert json.loads(render_json([])) == []


def test_hostile_text_stays_ascii() -> None:
    item = Diagnostic(code="c", severity=Severity.ERROR, message="\x1b\x00\udcff機")
    text = render_json([item])
    assert text.isascii()
    assert json.loads(text)[0]["message"] == "\x1b\x00\udcff機"


def test_rows_are_sorted_by_place() -> None:
    items = [
        Diagnostic(
            code=str(line),
            severity=Severity.ERROR,
            message="m",
            position=Position(file="f", line=line, column=1),
        )
        for line in (3, 1, 2)
    ]
    assert [row["line"] for row in json.loads(render_json(items))] == [1, 2, 3]
