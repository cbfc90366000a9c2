from __future__ import annotations

import subprocess
import sys
import zipfile
from importlib import metadata
from pathlib import Path

import pytest
from joshua.plugins import discovery
from joshua.plugins.discovery import PluginRow, discover, is_blocked


def distribution(
    folder: Path, name: str, entry_points: str, version: str = "1.0", form: str = "dist-info"
) -> Path:
    info = folder / (f"{name}-{version}.dist-info" if form == "dist-info" else f"{name}.egg-info")
    info.mkdir(parents=True)
    metadata_file = "METADATA" if form == "dist-info" else "PKG-INFO"
    (info / metadata_file).write_text(
        f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n", encoding="utf-8"
    )
    (info / "entry_points.txt").write_text(entry_points, encoding="utf-8")
    return info


def found(name: str) -> list[PluginRow]:
    return [candidate for candidate in discover() if candidate.distribution == name]


def test_it_finds_what_importlib_metadata_finds() -> None:
    mine = {(c.name, c.distribution, c.version, c.module) for c in discovery._from_folders()}
    theirs = {
        (e.name, discovery.normalise(e.dist.name), e.dist.version, e.value)
        for e in metadata.entry_points(group="joshua.plugins")
        if e.dist is not None
    }
    assert mine == theirs
    assert any(name == "joshua-core" for _, name, _, _ in mine)


def test_entries_of_the_group_are_read_and_no_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = """
    [console_scripts]
    acme = acme.cli:main
    [joshua.plugins]
    # a comment
    arm = acme.arm
    gripper=acme.gripper:plugin [extra]
    nonsense

    [other.group]
    arm = acme.other
    """
    distribution(tmp_path, "Acme.Robots", text, version="2.0rc1")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert found("acme-robots") == [
        PluginRow("arm", "acme-robots", "2.0rc1", module="acme.arm"),
        PluginRow("gripper", "acme-robots", "2.0rc1", module="acme.gripper:plugin"),
    ]


def test_the_first_on_the_module_path_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distribution(tmp_path / "old", "acme", "[joshua.plugins]\na = old\n", version="1.0")
    distribution(tmp_path / "new", "acme", "[joshua.plugins]\nb = new\n", version="2.0")
    monkeypatch.syspath_prepend(str(tmp_path / "old"))
    monkeypatch.syspath_prepend(str(tmp_path / "new"))
    assert found("acme") == [PluginRow("b", "acme", "2.0", module="new")]


def test_the_old_form_of_metadata_is_read_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distribution(tmp_path, "acme_old", "[joshua.plugins]\na = old\n", version="3.1", form="egg-info")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert found("acme-old") == [PluginRow("a", "acme-old", "3.1", module="old")]


def test_plugins_in_a_zip_file_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    info = distribution(tmp_path, "acme_zipped", "[joshua.plugins]\na = zipped\n")
    archive = tmp_path / "robots.zip"
    with zipfile.ZipFile(archive, "w") as file:
        for path in info.iterdir():
            file.write(path, f"{info.name}/{path.name}")
    monkeypatch.syspath_prepend(str(archive))
    assert found("acme-zipped") == [PluginRow("a", "acme-zipped", "1.0", module="zipped")]


def test_folders_that_are_not_there_do_not_matter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(tmp_path / "nowhere"))
    (tmp_path / "acme-1.0.dist-info").mkdir()
    monkeypatch.syspath_prepend(str(tmp_path))
    assert found("acme") == []
    assert found("joshua-core")


@pytest.mark.parametrize("name", ["acme-arm", "Acme_Arm", "ARM", "arm"])
def test_a_plugin_is_blocked_by_either_name(name: str) -> None:
    assert is_blocked(PluginRow("arm", "acme-arm", "1", module="x"), ["other", name])
    assert not is_blocked(PluginRow("arm", "acme-arm", "1", module="x"), ["other"])


def test_a_usual_environment_needs_no_importlib_metadata() -> None:
    code = (
        "import sys; from joshua.plugins import load_registry; load_registry(); "
        "sys.exit('email' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], timeout=60, check=True)
