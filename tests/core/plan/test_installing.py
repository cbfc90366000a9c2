"""Commands that install a distribution: what they name depends on where the core comes from."""

from __future__ import annotations

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
    assert installing.install("joshua-smolvla") == "this clone has no joshua-plugins/smolvla"
    assert installing.reinstall("joshua-lidar") == (
        "pip install --force-reinstall --no-deps -e ./joshua-plugins/lidar"
    )
    assert installing.upgrade("joshua-lidar") == "git pull && ./run --with lidar"
    assert not any("pip install joshua" in installing.install(name) for name in stated().distributions())


@pytest.mark.usefixtures("_in_the_clone")
def test_a_third_party_s_package_has_a_name_only() -> None:
    assert installing.install("acme-gripper") == "pip install acme-gripper"
    assert installing.reinstall("acme-gripper") == "pip install --force-reinstall acme-gripper"
    assert installing.upgrade("acme-gripper") == "pip install --upgrade acme-gripper"


def test_elsewhere_the_clone_is_named_in_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert installing.install("joshua-lidar") == f"{ROOT}/run --with lidar"


def test_without_a_clone_the_name_is_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installing, "clone", lambda: None)
    assert installing.install("joshua-lidar") == "pip install joshua-lidar"
    assert installing.reinstall("joshua-lidar") == "pip install --force-reinstall joshua-lidar"
    assert installing.upgrade("joshua-lidar") == "pip install --upgrade joshua-lidar"
    assert installing.target("joshua-core") == "joshua-core"
