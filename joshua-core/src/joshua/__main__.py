"""``python -m joshua``: the program, run by its package name."""

from __future__ import annotations

if __name__ == "__main__":
    from joshua.cli.program import program

    program()
