"""``joshua find-cameras`` on a machine without cameras, and how ``joshua`` finds it."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.cli.main import main
from joshua_camera import survey


def test_no_camera(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(survey.survey, "__defaults__", (None, tmp_path))
    assert main(["find-cameras"]) == 4
    text = capsys.readouterr().out
    assert text.startswith("no camera was found\n")
    assert "lsusb" in text
    assert 'source: "http://' in text
    assert main(["find-cameras", "--format", "json"]) == 4
    assert capsys.readouterr().out == "[]\n"


def test_help_names_the_options(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["find-cameras", "--help"])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    assert "list the cameras of this machine" in text
    assert "--save FOLDER" in text
