"""Files derived from protos that are stale are found, and generated anew.

Whether the committed ones are up to date is checked by ``nox -s proto``, which has their compiler.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the parts of the repository that the generator reads and writes."""
    for part in ("proto", "tools", "joshua-core/src/joshua/schema"):
        shutil.copytree(
            ROOT / part, tmp_path / part, symlinks=True, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(ROOT / "joshua-core/src/joshua/__init__.py", tmp_path / "joshua-core/src/joshua")
    return tmp_path


def run(root: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(root / "tools" / "generate_schema.py"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_changed_proto_makes_files_stale_until_they_are_generated(copy: Path) -> None:
    assert run(copy).returncode == 0
    proto = copy / "proto" / "comm.proto"
    proto.write_text(proto.read_text().replace("// ", "// In short: ", 1))
    schema = copy / "joshua-core/src/joshua/schema"
    (schema / "transport_pb2.py").unlink()
    (schema / "old_pb2.py").write_text("")
    (schema / "transport.proto").unlink()
    done = run(copy, "--check")
    assert done.returncode == 1
    for fault in (
        "transport.proto is no link to proto/transport.proto",
        "comm_pb2.comments.json is stale",
        "transport_pb2.py is missing",
        "old_pb2.py has no proto file",
    ):
        assert fault in done.stderr
    assert "nox -s proto" in done.stderr
    assert run(copy).returncode == 0
    assert run(copy, "--check").returncode == 0
