"""The table of codes holds every code that the program uses, no other, and each one is tried."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from joshua.config.codes import CODES, GROUPS

ROOT = Path(__file__).parents[3]
SOURCE = ROOT / "joshua-core" / "src" / "joshua"
CODE = re.compile(r"[a-z0-9]+(-[a-z0-9]+)+")
# Functions whose first or second argument is a code.
MAKERS = frozenset(
    ("error", "warning", "note", "make", "lacks", "_missing", "_note", "_missing_path", "_Kind")
)


def used_codes() -> dict[str, str]:
    """Codes in calls that make findings, and where each stands."""
    found: dict[str, str] = {}
    for path in sorted(SOURCE.rglob("*.py")):
        if path.name.endswith("_pb2.py"):
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Call):
                for code in codes_of_call(node):
                    found.setdefault(code, f"{path.relative_to(ROOT)}:{node.lineno}")
    return found


def codes_of_call(call: ast.Call) -> Iterator[str]:
    function = call.func
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    arguments = call.args[:2] if name in MAKERS else []
    arguments += [
        keyword.value for keyword in call.keywords if keyword.arg == "code" and name == "Diagnostic"
    ]
    for argument in arguments:
        if isinstance(argument, ast.Constant) and CODE.fullmatch(str(argument.value)):
            yield str(argument.value)


def literals(folder: Path) -> set[str]:
    """Every text of the sources that has the form of a code."""
    found = set()
    for path in folder.rglob("*.py"):
        if path.name.endswith("_pb2.py"):
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and CODE.fullmatch(node.value):
                found.add(node.value)
    return found


def test_the_search_finds_the_calls() -> None:
    assert len(used_codes()) > 80
    assert "topic-type-mismatch" in used_codes()


def test_every_code_in_use_is_documented() -> None:
    missing = {code: place for code, place in used_codes().items() if code not in CODES}
    assert not missing, "add these codes to a codes.json"


def test_every_documented_code_is_in_use() -> None:
    unused = set(CODES) - literals(SOURCE)
    assert not unused


def test_every_code_is_tried_by_the_corpus_or_a_test() -> None:
    tried = set(re.findall(r"\[([a-z0-9-]+)\]", expected_texts()))
    here = Path(__file__)
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        if path != here:
            tried.update(re.findall(CODE.pattern.replace("(", "(?:"), path.read_text(encoding="utf-8")))
    assert set(CODES) - set(GROUPS["planning"]) - tried == set()


def expected_texts() -> str:
    folder = Path(__file__).parent / "bad"
    return "".join(path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.expected")))


def test_rows_are_sentences() -> None:
    for code, doc in CODES.items():
        for text in (doc.cause, doc.next_step):
            assert text.endswith("."), code
            assert len(text) > 10, code
