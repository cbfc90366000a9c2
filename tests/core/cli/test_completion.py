from __future__ import annotations

import argparse
import contextlib
import os
import pty
import select
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from joshua.cli.main import actions, main
from joshua.cli.presets import preset_names
from joshua.cli.table import COMMANDS

BASH = shutil.which("bash") or "bash"
# What bash does on TAB: it looks up the registered function and calls it with the words so far.
CALL = """
source "$1"; shift
COMP_WORDS=("$@"); COMP_CWORD=$(( $# - 1 ))
specification=$(complete -p joshua); words=($specification)
for ((i = 0; i < ${#words[@]}; i++)); do [[ ${words[i]} == -F ]] && ${words[i+1]} joshua "${@: -1}"; done
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("completion") / "joshua.bash"
    with path.open("w") as file, contextlib.redirect_stdout(file):
        assert main(["--print-completion", "bash"]) == 0
    return path


def complete(script: Path, *words: str, cwd: Path | None = None) -> list[str]:
    result = subprocess.run(
        [BASH, "--norc", "--noprofile", "-c", CALL, "bash", script, "joshua", *words],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
        cwd=cwd,
    )
    return result.stdout.split()


def test_options_are_completed(script: Path):
    assert complete(script, "--val") == ["--validate-only"]
    assert {"--config", "--set", "--duration"} <= set(complete(script, "--"))


def test_commands_are_completed(script: Path):
    assert complete(script, "pre") == ["presets"]
    assert {command.name for command in COMMANDS} <= set(complete(script, ""))


def test_presets_are_completed(script: Path):
    simulations = [name for name in preset_names() if name.startswith("sim_")]
    assert sorted(complete(script, "new", "mine", "--from", "sim_")) == simulations
    assert sorted(complete(script, "presets", "sim_")) == simulations


def test_values_of_an_option_are_completed(script: Path):
    assert complete(script, "--log-level", "D") == ["DEBUG"]


def test_files_are_completed_for_config(script: Path, tmp_path: Path):
    (tmp_path / "my_robot.pbtxt").touch()
    (tmp_path / "my_folder").mkdir()
    assert sorted(complete(script, "--config", "my_", cwd=tmp_path)) == ["my_folder", "my_robot.pbtxt"]


def test_the_tab_key_of_an_interactive_bash_completes(script: Path):
    """A function stands for the program, so that Enter shows the completed words."""
    process, terminal = pty.fork()
    if process == 0:
        os.execve(BASH, [BASH, "--norc", "--noprofile", "-i"], {"TERM": "dumb", "PATH": os.environ["PATH"]})
    try:
        os.write(terminal, b"joshua() { printf '<%s>' \"$@\"; }\n")
        os.write(terminal, f"source {script} && echo rea''dy\n".encode())
        read_until(terminal, b"ready")
        os.write(terminal, b"joshua --valid\t\n")
        read_until(terminal, b"<--validate-only>")
    finally:
        os.close(terminal)
        os.kill(process, 9)
        os.waitpid(process, 0)


def read_until(terminal: int, wanted: bytes) -> None:
    seen, deadline = b"", time.monotonic() + 60
    while wanted not in seen:
        ready, _, _ = select.select([terminal], [], [], max(0.0, deadline - time.monotonic()))
        assert ready, f"waited for {wanted!r}, saw {seen!r}"
        seen += os.read(terminal, 4096)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_each_shell_is_accepted_by_it(shell: str, capsys: pytest.CaptureFixture[str]):
    assert main(["--print-completion", shell]) == 0
    script = capsys.readouterr().out
    assert "validate-only" in script
    assert "teleop_so_arm100" in script
    if program := shutil.which(shell):
        subprocess.run([program, "-n", "/dev/stdin"], input=script, text=True, check=True, timeout=60)


def test_files_are_completed_for_arguments_of_commands(script: Path, tmp_path: Path):
    (tmp_path / "my_robot.pbtxt").touch()
    assert complete(script, "fmt", "my_", cwd=tmp_path) == ["my_robot.pbtxt"]
    assert complete(script, "plan", "--config", "my_", cwd=tmp_path) == ["my_robot.pbtxt"]
    assert complete(script, "status", "my_", cwd=tmp_path) == ["my_robot.pbtxt"]


def test_completion_costs_nothing_unless_asked_for():
    code = "import sys; from joshua.cli.main import main; main([]); print('shtab' in sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert result.stdout.splitlines()[-1] == "False"


def test_an_unknown_shell_is_refused(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as refusal:
        main(["--print-completion", "tcsh"])
    assert refusal.value.code == 2
    said = capsys.readouterr().err
    assert "--print-completion is 'tcsh'; allowed: bash, zsh, fish" in said
    assert "nearest: task" not in said, "the nearest command is no shell"


def test_arguments_of_subcommands_are_found():
    parser = argparse.ArgumentParser()
    parser.add_subparsers().add_parser("inner").add_argument("--deep")
    assert "--deep" in {option for action in actions(parser) for option in action.option_strings}
