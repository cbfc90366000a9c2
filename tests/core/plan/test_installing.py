"""Commands that install a distribution: what they name depends on where the core comes from."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

import pytest
from joshua.plan import installing
from joshua.plugins.hints import stated

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def _in_the_clone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


@pytest.mark.usefixtures("_in_the_clone")
def test_in_a_clone_nothing_of_ours_is_named_that_an_index_could_answer() -> None:
    assert installing.install("joshua-lidar") == "./run --with lidar"
    assert installing.install("joshua-core") == "pip install -e ./joshua-core"
    assert installing.install("joshua-absent") == "this clone has no joshua-plugins/absent"
    assert installing.reinstall("joshua-lidar") == (
        "pip install --force-reinstall --no-deps -e ./joshua-plugins/lidar"
    )
    assert installing.upgrade("joshua-lidar") == "git pull && ./run --with lidar"
    assert not any("pip install joshua" in installing.install(name) for name in stated().distributions())


@pytest.mark.usefixtures("_in_the_clone")
def test_extras_are_installed_from_the_clone_too() -> None:
    assert installing.install("joshua-core", "plots") == "pip install -e './joshua-core[plots]'"
    assert installing.install("joshua-emulator", "spike") == "./run --with 'emulator[spike]'"


@pytest.mark.usefixtures("_in_the_clone")
def test_an_extra_is_there_when_all_that_it_brings_is(monkeypatch: pytest.MonkeyPatch) -> None:
    listed = {
        "acme": ["numpy>=1", 'acme-lib[fast]>=2 ; extra == "all"', 'acme-gone ; extra == "more"'],
        "acme-lib": ['acme-wheel; extra == "fast"'],
    }
    versions = {"acme-lib": "2", "acme-wheel": "1"}

    def version(name: str) -> str:
        if name not in versions:
            raise metadata.PackageNotFoundError(name)
        return versions[name]

    monkeypatch.setattr(metadata, "requires", lambda name: listed.get(name))
    monkeypatch.setattr(metadata, "version", version)
    assert installing.has_extra("acme", "all")
    assert not installing.has_extra("acme", "more")
    del versions["acme-wheel"]
    assert not installing.has_extra("acme", "all"), "the extra of what it needs"


def test_a_third_party_s_package_has_a_name_only() -> None:
    assert installing.install("acme-arm") == "pip install acme-arm"
    assert installing.reinstall("acme-arm") == "pip install --force-reinstall acme-arm"
    assert installing.upgrade("acme-arm") == "pip install --upgrade acme-arm"


@pytest.mark.usefixtures("_in_the_clone")
def test_a_third_party_s_package_comes_again_from_where_it_came() -> None:
    folder = ROOT / "docs/examples/acme-gripper"
    assert installing.reinstall("acme-gripper") == f"pip install --force-reinstall {folder}"


def test_elsewhere_the_clone_is_named_in_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert installing.install("joshua-lidar") == f"{ROOT}/run --with lidar"


def test_a_core_copied_out_of_a_clone_finds_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(installing, "__file__", str(tmp_path / "a/b/c/d/e.py"))
    installing.clone.cache_clear()
    assert installing.clone() == ROOT
    installing.clone.cache_clear()


def test_an_index_is_named_where_the_core_came_from_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installing, "clone", lambda: None)
    monkeypatch.setattr(installing, "origin", lambda *_: "")
    assert installing.install("joshua-lidar") == "pip install joshua-lidar"
    assert installing.install("joshua-core", "plots") == "pip install 'joshua-core[plots]'"
    assert installing.reinstall("joshua-lidar") == "pip install --force-reinstall joshua-lidar"
    assert installing.upgrade("joshua-lidar") == "pip install --upgrade joshua-lidar"
    assert installing.target("joshua-core") == "joshua-core"


@pytest.mark.parametrize("url", ["git+https://git.example.org/joshua.git", "file:///wheels/core.whl", None])
def test_no_index_is_named_where_the_core_came_from_elsewhere(
    monkeypatch: pytest.MonkeyPatch, url: str | None
) -> None:
    monkeypatch.setattr(installing, "clone", lambda: None)
    monkeypatch.setattr(installing, "origin", lambda *_: url)
    for command in (installing.install, installing.reinstall, installing.upgrade):
        said = command("joshua-lidar")
        assert said == "install joshua-lidar from the source that joshua-core was installed from"
