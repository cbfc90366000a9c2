"""Compiling a plugin's proto: the module, its comments, and what an author reads when it fails."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest
from joshua.schema.compile import CompileError, compile_protos, import_root, main

PROTO = """\
// Settings of a gripper.
syntax = "proto3";
package acme.compile_test;
import "joshua/schema/options.proto";

// A parallel
// gripper.
//
// Two paragraphs.
message Gripper {
  // Opening width.
  float stroke_m = 1 [(joshua.rule) = {unit: "m" min: 0 max: 0.2 required: true}];
  oneof link {
    int32 id = 2;  // Trailing comment.
  }
  // How it grips.
  enum Grip {
    // Not chosen.
    GRIP_UNSPECIFIED = 0;
  }
  // Inside another message.
  message Inner {
    // Deep field.
    Grip grip = 1;
  }
}
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    folder = tmp_path / "src" / "compiled_gripper"
    folder.mkdir(parents=True)
    (folder / "__init__.py").touch()
    (folder / "gripper.proto").write_text(PROTO)
    return folder


def test_a_plugin_proto_compiles_beside_itself(package: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(package / "gripper.proto")]) == 0
    names = ["gripper_pb2.comments.json", "gripper_pb2.py", "gripper_pb2.pyi"]
    assert sorted(path.name for path in package.glob("*_pb2*")) == names
    assert sorted(Path(line).name for line in capsys.readouterr().out.split()) == names
    # The name that the descriptor pool knows is that of the package, so that plugins do not collide.
    assert "compiled_gripper/gripper.proto" in (package / "gripper_pb2.py").read_text()


def test_comments_are_kept_by_full_name(package: Path) -> None:
    main([str(package / "gripper.proto")])
    table = json.loads((package / "gripper_pb2.comments.json").read_text())
    prefix = "acme.compile_test.Gripper"
    assert table == {
        "": "Settings of a gripper.",
        prefix: "A parallel gripper.\n\nTwo paragraphs.",
        f"{prefix}.Grip": "How it grips.",
        f"{prefix}.Grip.GRIP_UNSPECIFIED": "Not chosen.",
        f"{prefix}.Inner": "Inside another message.",
        f"{prefix}.Inner.grip": "Deep field.",
        f"{prefix}.id": "Trailing comment.",
        f"{prefix}.stroke_m": "Opening width.",
    }


def test_the_compiled_module_carries_rules_and_comments(package: Path, tmp_path: Path) -> None:
    main([str(package / "gripper.proto"), "--out", str(tmp_path / "out")])
    program = (
        "from compiled_gripper.gripper_pb2 import Gripper\n"
        "from joshua.schema.comments import comment\n"
        "from joshua.schema.rules import rule\n"
        "field = Gripper.DESCRIPTOR.fields_by_name['stroke_m']\n"
        "value = Gripper.Grip.DESCRIPTOR.values_by_name['GRIP_UNSPECIFIED']\n"
        "print(rule(field).unit, comment(field), comment(value),\n"
        "      comment(Gripper.DESCRIPTOR.oneofs[0]), sep='|')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path / "out", capture_output=True, text=True, check=True
    )
    assert done.stdout == "m|Opening width.|Not chosen.|\n"


def test_the_import_root_is_the_folder_above_the_package(package: Path) -> None:
    assert import_root(package / "gripper.proto") == package.parent.resolve()


def test_a_missing_file_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "none.proto")]) == 2
    assert "none.proto does not exist" in capsys.readouterr().err


def test_a_faulty_proto_is_reported_with_its_line(package: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (package / "gripper.proto").write_text('syntax = "proto3";\nmessage Gripper { floot width = 1; }\n')
    assert main([str(package / "gripper.proto")]) == 2
    assert "compiled_gripper/gripper.proto:2:19" in capsys.readouterr().err


def test_a_root_that_does_not_hold_the_file_is_refused(
    package: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "other").mkdir()
    assert main([str(package / "gripper.proto"), "--root", str(tmp_path / "other")]) == 2
    assert "Give a --root that contains it" in capsys.readouterr().err


def test_a_missing_compiler_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def none_found(name: str) -> None:
        assert name == "grpc_tools"

    monkeypatch.setattr(importlib.util, "find_spec", none_found)
    with pytest.raises(CompileError, match=r"pip install 'grpcio-tools<1\.72'"):
        compile_protos(["a.proto"], [str(tmp_path)], tmp_path)
