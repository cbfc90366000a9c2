"""Runs of the command ``joshua`` in a folder and a domain of their own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram


class Program(JoshuaProgram):
    """``joshua`` in a folder of its own."""

    def run(self, name: str, *words: str, **changed: str | int) -> str:
        """Runs a file to its end, without an error. Returns what it says.

        Args:
            name: of the file, without its ending; words: of the command.
            changed: fields by their path, as for ``--set``.
        """
        sets = [word for path, value in changed.items() for word in ("--set", f"{path}={value}")]
        if "--duration" in words:  # a short one also limits the start
            sets += ["--start-timeout", "200"]
        done = self("--config", f"{name}.pbtxt", *words, *sets, timeout_s=600)
        said = done.stdout + done.stderr
        assert done.returncode == 0, said
        assert "Traceback" not in said
        return said


@contextmanager
def program(folder: Path, environment: Mapping[str, str] | None = None) -> Iterator[Program]:
    """Makes the command usable, and ends what it started."""
    with reserved_domain() as domain:
        made = Program(folder, domain, environment)
        try:
            yield made
        finally:
            made.close()
