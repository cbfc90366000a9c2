"""Generates the reference pages of the documentation from the schema and the program."""

from __future__ import annotations

import sys


def main() -> int:
    """Writes every generated page and returns the exit code."""
    return 0


if __name__ == "__main__":
    sys.exit(main())
