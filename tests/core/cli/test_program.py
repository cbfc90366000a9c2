"""The first moments of ``joshua``: an interrupt while it is imported leaves no traceback."""

from __future__ import annotations

import subprocess
import sys

INTERRUPTED_IMPORT = """
import os, signal, sys

class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == MODULE:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupt())
sys.argv = ["joshua", "--version"]
from joshua.cli.program import program
program()
"""


def run(module: str) -> subprocess.CompletedProcess[str]:
    code = INTERRUPTED_IMPORT.replace("MODULE", repr(module))
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)


def test_an_interrupt_during_the_import_ends_it_quietly() -> None:
    result = run("joshua.cli.main")
    assert (result.returncode, result.stdout, result.stderr) == (130, "", "")


def test_an_interrupt_after_it_ends_it_quietly_too() -> None:
    result = run("importlib.metadata")  # which the command imports itself
    assert (result.returncode, result.stdout, result.stderr) == (130, "", "")


def test_without_one_the_command_runs() -> None:
    result = run("")
    assert result.returncode == 0
    assert result.stdout.startswith("joshua ")


def test_the_package_runs_like_the_command() -> None:
    command = [sys.executable, "-m", "joshua", "--version"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert result.returncode == 0
    assert result.stdout.startswith("joshua ")
