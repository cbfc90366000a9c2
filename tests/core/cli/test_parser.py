"""Unknown options are refused by the command that was given, with its own nearest option."""

from __future__ import annotations

import pytest
from joshua.cli.parser import parse


@pytest.mark.parametrize(
    ("words", "first", "nearest"),
    [
        (("find-port", "--prot", "x"), "joshua find-port: error: unrecognized arguments: --prot x", "--port"),
        (
            ("motors", "setup", "--id", "1"),
            "joshua motors setup: error: unrecognized arguments: --id 1",
            "--ids",
        ),
        (("doctor", "--udve"), "joshua doctor: error: unrecognized arguments: --udve", "--udev"),
        (("fmt", "a.pbtxt", "--chek"), "joshua fmt: error: unrecognized arguments: --chek", "--check"),
    ],
)
def test_a_misspelt_option_of_a_command(
    words: tuple[str, ...], first: str, nearest: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        parse(words)
    assert ended.value.code == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == first
    assert lines[1] == f"  nearest: {nearest}"
    assert lines[2].startswith(f"  see: {first.partition(':')[0]} --help")
