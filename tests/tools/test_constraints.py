"""The pins cover what the repository asks for, and fit it."""

from __future__ import annotations

import re
from pathlib import Path

import nox.project
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
# Extras that no session installs, for their size.
UNTESTED = {"rerun-sdk"}
# Groups of sessions that install older versions than the pins.
UNPINNED = {"proto", "lowest"}
MANIFESTS = [
    ROOT / "pyproject.toml",
    *ROOT.glob("joshua-*/pyproject.toml"),
    *ROOT.glob("joshua-plugins/*/pyproject.toml"),
]


def pins(file: str = "constraints.txt") -> dict[str, Requirement]:
    lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
    found = [Requirement(line) for line in lines if line and not line.startswith("#")]
    return {canonicalize_name(requirement.name): requirement for requirement in found}


def learning_pins() -> dict[str, Requirement]:
    """The pins of the session `learn`; what is compiled against torch is installed first."""
    text = (ROOT / "constraints-learn.txt").read_text(encoding="utf-8")
    first = re.search(r"pip install (torch==.+) &&", text)
    assert first is not None
    compiled = [Requirement(word) for word in first.group(1).split()]
    return {**pins("constraints-learn.txt"), **{item.name: item for item in compiled}}


def test_the_packages_of_models_have_the_versions_that_the_other_sessions_use():
    ours = pins()
    shared = {name: pin for name, pin in pins("constraints-models.txt").items() if name in ours}
    assert shared.keys() >= {"gymnasium"}
    assert {name: str(ours[name].specifier) for name in shared} == {
        name: str(pin.specifier) for name, pin in shared.items()
    }


def test_the_session_learn_installs_the_torch_that_the_file_of_pins_names():
    noxfile = (ROOT / "noxfile.py").read_text(encoding="utf-8")
    for name in ("torch", "torchvision", "torchcodec"):
        assert f'"{learning_pins()[name]}"' in noxfile


def requirements(manifest: Path) -> list[Requirement]:
    content = nox.project.load_toml(manifest)
    project = content.get("project", {})
    groups = [
        *project.get("optional-dependencies", {}).values(),
        *(items for name, items in content.get("dependency-groups", {}).items() if name not in UNPINNED),
    ]
    texts = [
        *project.get("dependencies", ()),
        *(text for group in groups for text in group if isinstance(text, str)),
    ]
    return [Requirement(text) for text in texts]


def test_each_pin_is_one_version_and_each_name_stands_once():
    lines = [
        line
        for line in (ROOT / "constraints.txt").read_text().splitlines()
        if line and not line.startswith("#")
    ]
    for line in lines:
        assert re.fullmatch(r'[a-z0-9-]+==[0-9][\w.+]*( ; python_version >= "3\.\d+")?', line), line
    assert len(lines) == len(pins())


@pytest.mark.parametrize("manifest", MANIFESTS, ids=lambda path: path.parent.name)
def test_every_requirement_is_pinned_to_a_version_that_fits_it(manifest: Path):
    known = {**learning_pins(), **pins()}
    for requirement in requirements(manifest):
        name = canonicalize_name(requirement.name)
        if name.startswith("joshua") or name in UNTESTED:
            continue
        assert name in known, f"{name} has no pin: run `nox -s pins`"
        (specifier,) = known[name].specifier
        assert requirement.specifier.contains(specifier.version), f"{requirement} against {known[name]}"
