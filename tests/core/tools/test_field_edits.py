"""Loading a file whose text a command changes."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.tools import EditError, ExitCode, load_readable


def test_a_file_with_errors_is_refused_with_all_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path("robot.pbtxt")
    path.write_text("general { mod: MODE_TEST }\nrobott {}\n")
    with pytest.raises(EditError) as caught:
        load_readable(str(path))
    assert caught.value.code is ExitCode.INVALID
    said = str(caught.value)
    assert said.startswith(f"{path} cannot be read:\n")
    assert "General has no field mod" in said
    assert "robott" in said


def test_a_file_with_notes_can_be_changed(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text("robot { actions { node { node_id: 010 } } }\n")
    loaded = load_readable(str(path))
    assert [item.code for item in loaded.diagnostics] == ["number-octal"]
    assert loaded.config.robot.actions[0].node.node_id == 8
