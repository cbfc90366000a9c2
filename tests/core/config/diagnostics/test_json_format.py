"""Findings as JSON for editors."""

from __future__ import annotations

import json

from joshua.config.diagnostics import render_json
from joshua.plan import Diagnostic, Position, Related, Severity


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
