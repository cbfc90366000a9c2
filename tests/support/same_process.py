"""Commands of the program, called in this process: to ask a run again and again starts no process."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
from collections.abc import Mapping
from pathlib import Path
from unittest.mock import patch

from joshua.cli.main import main


def joshua_here(
    *words: str, environment: Mapping[str, str], folder: Path
) -> subprocess.CompletedProcess[str]:
    """What ``joshua WORDS`` answers in an environment and a folder; for commands that run no robot."""
    output, errors = io.StringIO(), io.StringIO()
    before = Path.cwd()
    os.chdir(folder)
    try:
        with (
            patch.dict(os.environ, environment, clear=True),
            contextlib.redirect_stdout(output),
            contextlib.redirect_stderr(errors),
        ):
            code = main(words)
    except SystemExit as ended:  # of the parser
        code = ended.code if isinstance(ended.code, int) else 1
    finally:
        os.chdir(before)
    return subprocess.CompletedProcess(words, code, output.getvalue(), errors.getvalue())
