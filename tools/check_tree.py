"""Checks what must never be committed: machine paths, registry hosts, large or built files, wrong names.

Prints one line for each finding and exits with 1 when there is any.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# Each pattern is written so that it does not match itself.
MACHINE_PATH = re.compile(
    r"(?<![\w./-])/(?:home/(?!user\b|someone\b)|Users/|root/|work/|farm/)[\w.-]|/opt/(?:wheels|py[p]i)"
)
REGISTRY_HOST = re.compile(r"py[p]i\.org|python[h]osted|registry\.npm[j]s|deb\.deb[i]an|anaconda\.[o]rg")
PINNED_ADDRESS = re.compile(r"://|--hash|--index-url|--extra-index-url|--find-links")

# The types are those of [tool.towncrier] in pyproject.toml; towncrier itself passes over any other name.
FRAGMENT = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*\.(added|changed|fixed|removed)\.md")
FRAGMENTS_FOLDER = Path("changes")
NOT_FRAGMENTS = frozenset(("README.md", "_template.md"))

# One idea per file. A longer module says in its docstring why it is one file; none is longer than the limit.
LINES_WITHOUT_REASON = 400
MAX_SOURCE_LINES = 600
# Nothing in the tree needs more; what is built or downloaded does.
MAX_BYTES = 1_000_000
BUILT = frozenset((".whl", ".gz", ".zip", ".so", ".pyc"))
REASON = re.compile(r"^\s*Why one file: \S", re.MULTILINE)


def main() -> int:
    """Prints every finding and returns the exit code."""
    findings = [finding for path in tracked_files() for finding in examine(path)]
    for finding in findings:
        sys.stdout.write(finding + "\n")
    return 1 if findings else 0


def tracked_files() -> list[Path]:
    """Lists the files that git knows or would add."""
    listing = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    return [ROOT / name for name in listing.split("\0") if name and (ROOT / name).is_file()]


def examine(path: Path) -> Iterator[str]:
    """Yields the findings of one file."""
    if path.suffix in BUILT:
        yield f"{path.relative_to(ROOT)}: a built or downloaded file: delete it"
        return
    if (size := path.stat().st_size) > MAX_BYTES:
        yield f"{path.relative_to(ROOT)}: {size} bytes, at most {MAX_BYTES}: generate it, or make it smaller"
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError:
        return
    name = path.relative_to(ROOT)
    for number, line in enumerate(lines, start=1):
        if match := MACHINE_PATH.search(line):
            yield f"{name}:{number}: path of one machine: {match.group()}"
        if match := REGISTRY_HOST.search(line):
            yield f"{name}:{number}: host of a package registry: {match.group()}"
        if path.name == "constraints.txt" and (match := PINNED_ADDRESS.search(line)):
            yield f"{name}:{number}: a constraint is a name and a version only, found {match.group()}"
    if name.parent == FRAGMENTS_FOLDER and path.name not in NOT_FRAGMENTS:
        if not FRAGMENT.fullmatch(path.name):
            yield f"{name}: a fragment is named <slug>.<added|changed|fixed|removed>.md, as bus-scan.added.md"
        elif not any(line.strip() for line in lines):
            yield f"{name}: the fragment is empty: say what changes for a user"
    if path.suffix == ".py" and not path.stem.endswith("_pb2"):
        yield from (f"{name}: {finding}" for finding in size_findings("\n".join(lines), len(lines)))


def size_findings(text: str, count: int) -> Iterator[str]:
    """Yields what is wrong with the length of a hand-written module."""
    if count > MAX_SOURCE_LINES:
        yield f"{count} lines, at most {MAX_SOURCE_LINES}: split it by idea"
    elif count > LINES_WITHOUT_REASON and not REASON.search(ast.get_docstring(ast.parse(text)) or ""):
        yield (
            f"{count} lines, above {LINES_WITHOUT_REASON} only with a reason: split it by idea, "
            "or add a line `Why one file: …` to the module's docstring"
        )


if __name__ == "__main__":
    sys.exit(main())
