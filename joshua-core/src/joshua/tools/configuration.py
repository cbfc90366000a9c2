"""Checking, planning and finding values in a file, as functions that open no device."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from joshua.planner.pipeline import PipelineResult


def check(path: str | os.PathLike[str], **options: Any) -> PipelineResult:
    """Find every problem of a configuration file. Never raises because of its content.

    Args:
        path: of the file; options: fields of ``Request``, such as ``overrides`` or ``emulate``.
    """
    return _examined(path, "VALIDATE", options)


def plan(path: str | os.PathLike[str], **options: Any) -> PipelineResult:
    """Check a file and, if it has no errors, plan what it starts."""
    return _examined(path, "SHOW", options)


def spans(text: str, field_path: str) -> list[tuple[int, int]]:
    """Find the values of a field in a configuration text, for a program that edits it.

    Args:
        text: of a file; field_path: such as ``calibration.arms``, without indices.

    Returns:
        Start and end offset of each value, brackets of blocks included, in the order of the text.

    Raises:
        ValueError: the text is not readable. The message says why.
    """
    from joshua.textproto.diagnostics import Diagnostics
    from joshua.textproto.lexer import tokenize
    from joshua.textproto.parser import Parser
    from joshua.textproto.source import Source
    from joshua.textproto.syntax import Block, ListValue

    source = Source("", text)
    problems = Diagnostics()
    fields = Parser(source, tokenize(source), problems).document()
    if len(problems):
        raise ValueError(problems.items[0].message)
    values: list[Any] = []
    for name in field_path.split("."):
        named = [field.value for field in fields if field.name == name]
        values = [
            item for value in named for item in (value.items if isinstance(value, ListValue) else (value,))
        ]
        fields = [field for value in values if isinstance(value, Block) for field in value.fields]
    return [(value.start, value.end) for value in values]


def calibration_place(emulate: bool, simulate: bool = False) -> Callable[[str, str], str]:
    """Return the rule that names the calibration file for a configuration's path and its robot's id.

    Args:
        emulate, simulate: whether the arms are emulated or simulated. Those calibrations are kept per user.
    """
    import os

    from joshua.ipc.run_bases import state_home
    from joshua.planner import calibration_place as places

    return places.calibration_place(state_home(os.environ), emulate=emulate, simulate=simulate)


def _examined(path: str | os.PathLike[str], purpose: str, options: dict[str, Any]) -> PipelineResult:
    import os

    from joshua.cli.report import state_home_of
    from joshua.planner.pipeline import examine
    from joshua.planner.request import Purpose, Request

    stand_ins = {name: bool(options.get(name)) for name in ("emulate", "simulate")}
    options = {"state_home": state_home_of(**stand_ins), **options}
    return examine(Request(os.fspath(path), purpose=Purpose[purpose], **options))
