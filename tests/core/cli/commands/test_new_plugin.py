"""``joshua new-plugin``: what it writes, and what it refuses."""

from __future__ import annotations

import argparse
import ast
import re
from pathlib import Path

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorProto
from joshua.cli.commands import new_plugin
from joshua.schema.compile import PACKAGE_ROOT, compile_protos


def run(*words: str) -> int:
    parser = argparse.ArgumentParser()
    new_plugin.add_arguments(parser)
    return new_plugin.run(parser.parse_args(words))


def descriptor(module: str) -> FileDescriptorProto:
    found = re.search(r"AddSerializedFile\(\s*(b'.*?')\s*\)\n", module)
    assert found is not None
    return FileDescriptorProto.FromString(ast.literal_eval(found[1]))


@pytest.mark.parametrize("kind", new_plugin.KINDS)
def test_the_files_bear_the_names_of_the_author(kind: str) -> None:
    files = new_plugin.files_of("acme-soft-hand", kind)
    assert set(files) == {
        *("pyproject.toml", "README.md", "robot.pbtxt", "tests/test_soft_hand.py"),
        *(f"src/acme_soft_hand/{name}.py" for name in ("__init__", kind, "plugin", "settings")),
        *("src/acme_soft_hand/py.typed", "src/acme_soft_hand/soft_hand.proto"),
        *("src/acme_soft_hand/soft_hand_pb2.py", "src/acme_soft_hand/soft_hand_pb2.comments.json"),
    }
    assert f"class SoftHand({kind.capitalize()}):" in files[f"src/acme_soft_hand/{kind}.py"]
    assert "[type.example.org/acme.SoftHandConfig]" in files["robot.pbtxt"]
    assert not [path for path, text in files.items() if "$" in text and not path.endswith("_pb2.py")]
    assert "package hand;" in new_plugin.files_of("hand", kind)["src/hand/hand.proto"]


@pytest.mark.parametrize("kind", new_plugin.KINDS)
def test_the_compiled_module_is_what_the_compiler_makes(kind: str, tmp_path: Path) -> None:
    files = new_plugin.files_of("acme-hand", kind)
    proto = tmp_path / "acme_hand/hand.proto"
    proto.parent.mkdir()
    proto.write_text(files["src/acme_hand/hand.proto"])
    module, _, comments = compile_protos(
        [f"acme_hand/{proto.name}"], [str(tmp_path), str(PACKAGE_ROOT)], tmp_path
    )
    assert descriptor(files["src/acme_hand/hand_pb2.py"]) == descriptor(module.read_text())
    assert files["src/acme_hand/hand_pb2.comments.json"] == comments.read_text()


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("Acme_Hand", "'Acme_Hand' is not a valid name\n  allowed: lower-case words joined by -"),
        ("../hand", "'../hand' is not a valid name"),
        ("joshua-hand", "'joshua-hand' begins with a name that is taken\n  begin it with your own"),
        ("json", "'json' begins with a name that is taken"),
        ("class-room", "'class-room' begins with a name that is taken"),
        ("acme-hand", "acme-hand exists already, so nothing was written\n  choose another name"),
    ],
)
def test_what_is_refused(
    name: str,
    problem: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "acme-hand").mkdir()
    assert run(name) == 2
    assert capsys.readouterr().err.startswith(f"joshua new-plugin: {problem}")
    assert [path.name for path in tmp_path.rglob("*")] == ["acme-hand"]
