"""``python -m joshua``: the program by the name of its package."""

from __future__ import annotations

if __name__ == "__main__":
    from joshua.cli.program import program

    program()
