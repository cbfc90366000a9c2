"""Writes ``constraints.txt``: the versions installed beside this interpreter, as pins for everyone.

Run by ``nox -s pins`` in a fresh environment that holds everything the sessions and plugins need.
"""

from __future__ import annotations

import re
import sys
from importlib.metadata import Distribution, distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

HEAD = """\
# Versions that were tested together on Python 3.11: pip install -c constraints.txt -e joshua-core
#
# Packages that have left Python 3.10 behind are held from 3.11 on only; on 3.10 pip takes the newest
# release that still supports it. Written by `nox -s pins`.
"""

# What every environment brings along.
BASIC = frozenset(("pip", "setuptools", "wheel"))


def main() -> int:
    """Writes the file and returns the exit code."""
    pins = sorted({pin(distribution) for distribution in distributions() if is_foreign(distribution)})
    (ROOT / "constraints.txt").write_text(HEAD + "\n".join(pins) + "\n", encoding="utf-8")
    return 0


def name_of(distribution: Distribution) -> str:
    """Name of a distribution in its normal form (PyPA «Names and normalization»)."""
    return re.sub(r"[-_.]+", "-", distribution.metadata["Name"]).lower()


def is_foreign(distribution: Distribution) -> bool:
    """Whether a distribution is neither part of this repository nor of every environment."""
    editable = '"editable": true' in (distribution.read_text("direct_url.json") or "")
    return not editable and name_of(distribution) not in BASIC


def pin(distribution: Distribution) -> str:
    """Line for one distribution; a marker where it needs a newer Python than the oldest supported."""
    needs = str(distribution.metadata.json.get("requires_python", ""))
    match = re.search(r">=\s*3\.(\d+)", needs)
    newer = f' ; python_version >= "3.{match[1]}"' if match and int(match[1]) > 10 else ""
    return f"{name_of(distribution)}=={distribution.version}{newer}"


if __name__ == "__main__":
    sys.exit(main())
