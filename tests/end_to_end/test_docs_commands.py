"""Every command of the documentation and of the README runs, in the order of its page."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from doc_commands import Step, steps

ROOT = Path(__file__).resolve().parents[2]
# Examples have a test of their own; the commands of their pages install a package.
PAGES = [
    ROOT / "README.md",
    *sorted(page for page in (ROOT / "docs").rglob("*.md") if "examples" not in page.parts),
]
TIMEOUT_S = 250
# Runs of pages that a test of their own does in the same way, and looks at closely: their files and options.
ELSEWHERE = {
    ("configs/test_mock_hardware.pbtxt", ""),  # test_presets_run.py
    ("configs/test_single_motor.pbtxt", "--emulate --set test.duration_s=4"),  # test_single_motor.py
    ("docs/examples/acme-gripper/robot.pbtxt", ""),  # test_third_party_plugin.py
}


class Terminal:
    """The shell of a reader: a folder, an environment, and at most one command in the background."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._environment = os.environ | {
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "XDG_RUNTIME_DIR": str(folder / "runtime"),
            "COLUMNS": "100",
            "XDG_STATE_HOME": str(folder / "state"),
        }
        (folder / "runtime").mkdir(mode=0o700)
        (folder / "docs").symlink_to(ROOT / "docs")
        self._background: subprocess.Popen[bytes] | None = None
        self._log = folder / "background.log"

    def run(self, step: Step) -> None:
        """Does one step of a page."""
        if step.interrupt:
            self.interrupt()
        elif step.until:
            self._start(step)
        else:
            for command in step.commands:
                last = command == step.commands[-1]
                self._foreground(command, step.exit_code if last else 0)

    def _foreground(self, command: str, expected: int) -> None:
        result = subprocess.run(
            ["bash", "-c", command],
            cwd=self._folder,
            env=self._environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
        )
        said = f"{command}\n{result.stdout[-4000:]}{result.stderr[-4000:]}"
        assert result.returncode == expected, f"exit code {result.returncode}, expected {expected}: {said}"
        assert "Traceback" not in said

    def _start(self, step: Step) -> None:
        assert self._background is None, "one command in the background is enough"
        (command,) = step.commands
        with self._log.open("wb") as log:
            self._background = subprocess.Popen(
                ["bash", "-c", f"exec {command}"],
                cwd=self._folder,
                env=self._environment | {"PYTHONUNBUFFERED": "1"},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        deadline = time.monotonic() + TIMEOUT_S
        while step.until not in self._said():
            assert self._background.poll() is None, f"{command} ended early:\n{self._said()}"
            assert time.monotonic() < deadline, f"{command} never said {step.until!r}:\n{self._said()}"
            time.sleep(0.05)

    def _said(self) -> str:
        return self._log.read_text(encoding="utf-8", errors="replace")

    def interrupt(self) -> None:
        """Ctrl-C in the background command's terminal; it must end in good order."""
        assert self._background is not None, "nothing runs in the background"
        os.killpg(self._background.pid, signal.SIGINT)
        assert self._background.wait(TIMEOUT_S) == 0, self._said()
        self._background = None

    def close(self) -> None:
        """Ends what a failed page left behind."""
        if self._background is not None:
            os.killpg(self._background.pid, signal.SIGKILL)
            self._background.wait()
            self._background = None


@pytest.fixture
def terminal(tmp_path: Path, joshua_domain_id: int) -> Iterator[Terminal]:
    opened = Terminal(tmp_path)
    yield opened
    opened.close()


def commanding_pages() -> list[Path]:
    return [page for page in PAGES if steps(page)]


def judged_runs(page: Path) -> dict[str, tuple[str, str]]:
    """The commands of a page that run a file in MODE_TEST, which judges rates: what they run, and how."""
    files: dict[str, tuple[Path, str]] = {}  # by the name on the page: what it is a copy of, and its changes
    found = {}
    for command in (command for step in steps(page) for command in step.commands):
        if made := re.match(r"joshua new (\S+) --from (\S+)", command):
            files[f"{made[1]}.pbtxt"] = ROOT / "configs" / f"{made[2]}.pbtxt", ""
        elif (changed := re.match(r"sed .* (\S+)$", command)) and changed[1] in files:
            source, changes = files[changed[1]]
            files[changed[1]] = source, changes + command
        run = re.match(r"joshua --config (\S+)(?!.*--validate-only)(?!.*general\.mode=) *(.*)", command)
        source, changes = files.get(run[1], (ROOT / run[1], "")) if run else (page, "")
        if run and "mode: MODE_TEST" in source.read_text(encoding="utf-8"):
            found[command] = f"{source.relative_to(ROOT)}{changes}", run[2]
    return found


def different_runs() -> dict[Path, set[str]]:
    """The judged runs of the pages, each of them once."""
    seen, found = set(ELSEWHERE), {}
    for page in PAGES:
        runs = judged_runs(page)
        if new := {command for command in runs if runs[command] not in seen}:
            found[page] = new
        seen |= set(runs.values())
    return found


def named(pages: Iterable[Path]) -> list[Any]:
    return [pytest.param(page, id=str(page.relative_to(ROOT))) for page in pages]


def walk(page: Path, terminal: Terminal, wanted: Callable[[str], bool]) -> None:
    """Does the steps of a page, with the commands that are wanted; Ctrl-C is the command ""."""
    for step in steps(page):
        commands = tuple(filter(wanted, step.commands))
        if not commands and not (step.interrupt and wanted("")):
            continue
        exit_code = step.exit_code if commands[-1:] == step.commands[-1:] else 0
        try:
            terminal.run(replace(step, commands=commands, exit_code=exit_code))
        except AssertionError as error:
            raise AssertionError(f"{page.relative_to(ROOT)}:{step.line}: {error}") from error
    assert terminal._background is None, "the page leaves a command running: say when to press Ctrl-C"


@pytest.mark.timeout(1500)
@pytest.mark.parametrize("page", named(commanding_pages()))
def test_the_commands_of_a_page_run(page: Path, terminal: Terminal):
    """All but those that judge rates, which the next test runs, each once and alone."""
    runs = judged_runs(page)
    walk(page, terminal, lambda command: command not in runs)


@pytest.mark.timing
@pytest.mark.parametrize("page", named(different_runs()))
def test_the_runs_of_a_page_pass(page: Path, terminal: Terminal):
    """Those that judge rates, with what makes and changes their files."""
    runs = different_runs()[page]
    files = re.compile("joshua new |sed |cat |mkdir ")
    walk(page, terminal, lambda command: command in runs or files.match(command) is not None)


def test_what_another_test_runs_is_on_a_page():
    assert {run for page in PAGES for run in judged_runs(page).values()} >= ELSEWHERE


def test_the_pages_that_a_newcomer_reads_have_commands():
    names = {str(page.relative_to(ROOT)) for page in commanding_pages()}
    assert {"README.md", "docs/index.md", "docs/tutorial.md", "docs/concepts.md"} <= names


def test_commands_stand_in_blocks_that_are_run():
    """A shell block of another language name would be left out silently."""
    fences = re.compile(r"^ *```+ *(\S*)", re.MULTILINE)
    for page in PAGES:
        names = set(fences.findall(page.read_text(encoding="utf-8")))
        assert names <= {"", "console", "bash", "text", "protobuf", "python", "toml", "json", "cpp"}, page
    assert shutil.which("bash")


def test_every_command_in_running_text_exists():
    from joshua.cli.parser import build_parser
    from joshua.cli.table import COMMANDS
    from joshua.plugins.hints import stated

    options = {option for action in build_parser()._actions for option in action.option_strings}
    known = {command.name for command in COMMANDS} | options
    known |= set(stated().commands)
    changelog = ROOT / "docs/reference/changelog.md"  # generated; it quotes what the program once refused
    for page in (page for page in PAGES if page != changelog):
        for word in re.findall(r"`joshua (\S+?)[ `]", page.read_text(encoding="utf-8")):
            first = word.split("|")[0]
            assert first in known or first == "…", f"{page.relative_to(ROOT)}: joshua {word}"


def test_the_files_that_pages_include_exist():
    marks = [
        (page, line)
        for page in sorted((ROOT / "docs").rglob("*.md"))
        for line in page.read_text(encoding="utf-8").splitlines()
        if line.startswith("--8")
    ]
    assert marks
    for page, line in marks:
        found = re.fullmatch(r'--8<-- "([^"]+)"', line)
        assert found, f"{page}: {line!r} is no include mark"
        assert (ROOT / found[1]).is_file(), f"{page}: {found[1]} does not exist"
