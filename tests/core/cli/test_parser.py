"""Unknown options are refused by the command that was given, with its own nearest option."""

from __future__ import annotations

import pytest
from joshua.cli.main import main
from joshua.cli.parser import parse
from joshua.cli.presets import FOLDER


@pytest.mark.parametrize(
    "words", [("arm.pbtxt",), ("run", "arm.pbtxt"), ("--host", "pi", "start", "arm.pbtxt")]
)
def test_a_file_where_a_command_belongs_is_told_how_it_runs(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        parse(words)
    assert ended.value.code == 2
    assert "\n  to run a file: joshua --config arm.pbtxt\n" in capsys.readouterr().err


def test_a_file_with_a_space_is_quoted(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parse(["my arm.pbtxt"])
    assert "\n  to run a file: joshua --config 'my arm.pbtxt'\n" in capsys.readouterr().err


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


@pytest.mark.parametrize(
    ("words", "first"),
    [
        (("--dry-run", "doctor"), "--dry-run has no effect on joshua doctor: leave it out"),
        (("--emulate", "status"), "--emulate has no effect on joshua status: leave it out"),
        (("--config", "x", "explain"), "--config has no effect on joshua explain: leave it out"),
        (
            ("--set", "a=1", "plan", "x", "--set=b=1"),
            "--set is given before and after plan: write it once, after plan",
        ),
        (("--config", "x", "plan", "y"), "two files are given, x and y: leave one out"),
    ],
)
def test_an_option_of_a_run_before_a_command_is_refused(
    words: tuple[str, ...], first: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        parse(words)
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith(f"joshua: error: {first}")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (
            ("fmmt",),
            "joshua: error: there is no command 'fmmt'\n  nearest: fmt\n  see: joshua --help\n",
        ),
        (
            ("--format", "xml"),
            "joshua: error: --format is 'xml'; allowed: text, json\n  see: joshua --help\n",
        ),
    ],
)
def test_a_value_that_does_not_exist(
    words: tuple[str, ...], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        parse(words)
    assert ended.value.code == 2
    assert capsys.readouterr().err == expected


@pytest.mark.parametrize("command", ["plan", "status", "stop", "estop", "emulate", "doctor"])
def test_a_file_is_an_argument_or_an_option_before_or_after_the_command(command: str) -> None:
    for words in ((command, "x"), (command, "--config", "x"), ("--config", "x", command)):
        _, arguments = parse(words)
        assert (arguments.command, arguments.config) == (command, "x")


def test_two_files_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        parse(("plan", "--sim", "x", "--config", "y"))
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith(
        "joshua plan: error: two files are given, x and y: leave one out"
    )


def test_options_that_count_before_a_command_are_taken() -> None:
    _, arguments = parse(("--dry-run", "--config", "x", "plan"))
    assert (arguments.dry_run, arguments.config) == (True, "x")
    _, arguments = parse(("--fault", "arm:drop=1", "emulate", "x"))
    assert arguments.faults == ["arm:drop=1"]
    _, arguments = parse(("--format", "json", "status"))
    assert arguments.format == "json"


def test_a_slip_in_a_range_of_ids_is_refused_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parse(("motors", "setup", "--ids", "1-60000000000"))
    assert "expected ids, each once, such as 1-6" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (("--fault", "arm:drop=1"), "joshua: error: --fault affects emulated devices only"),
        (
            ("--validate-only", "--fault", "arm:drop=1"),
            "joshua: error: --fault affects emulated devices only",
        ),
        (
            ("--validate-only", "--emulate", "--fault", "a:b"),
            "joshua: error: --fault has no effect with",
        ),
        (("--open",), "joshua: error: --open shows the page of a calibration"),
        (("find-port", "--node", "arm"), "joshua find-port: --node has no effect without --write"),
        (("doctor", "--port", "/dev/x"), "joshua doctor: --config checks the devices of the file"),
    ],
)
def test_an_option_that_would_do_nothing_is_refused(
    words: tuple[str, ...], problem: str, capsys: pytest.CaptureFixture[str]
) -> None:
    config = () if words[0] == "find-port" else ("--config", str(FOLDER / "test_mock_hardware.pbtxt"))
    assert main([*words, *config]) == 2
    assert capsys.readouterr().err.startswith(problem)
