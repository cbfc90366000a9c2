from __future__ import annotations

from pathlib import Path

import check_tree
import nox.project
import pytest

# Put together, so that this file passes the check itself.
HOST = ".".join(("pypi", "org"))


@pytest.fixture(autouse=True)
def _root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check_tree, "ROOT", tmp_path)


def findings(tmp_path: Path, name: str, text: str) -> list[str]:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    return list(check_tree.examine(path))


@pytest.mark.parametrize("path", ["home/ann/robot", "Users/ann", "root/x", "work/main"])
def test_a_path_of_one_machine_is_found(tmp_path: Path, path: str):
    assert findings(tmp_path, "a.md", f"see\n/{path} for it")[0].startswith("a.md:2: path of one machine:")


@pytest.mark.parametrize("text", ["docs/home/x", "the /home/user folder", "/opt/policy-venv/bin/python"])
def test_other_paths_may_stand(tmp_path: Path, text: str):
    assert findings(tmp_path, "a.md", text) == []


def test_a_registry_host_is_found(tmp_path: Path):
    assert findings(tmp_path, "a.toml", f"url = 'https://{HOST}/simple'") == [
        f"a.toml:1: host of a package registry: {HOST}"
    ]


@pytest.mark.parametrize("line", ["numpy @ https://example.org/x.whl", "numpy==2 --hash=sha256:00"])
def test_a_constraint_is_a_name_and_a_version(tmp_path: Path, line: str):
    assert "a name and a version only" in findings(tmp_path, "constraints.txt", line)[0]


@pytest.mark.parametrize("name", ["numpy-2.4.6-cp311.whl", "joshua.tar.gz"])
def test_a_built_file_is_found(tmp_path: Path, name: str):
    assert findings(tmp_path, name, "PK") == [f"{name}: a built or downloaded file: delete it"]


def test_a_large_file_is_found_text_or_not(tmp_path: Path):
    path = tmp_path / "arm.png"
    path.write_bytes(b"\xff" * 1_000_001)
    assert list(check_tree.examine(path)) == [
        "arm.png: 1000001 bytes, at most 1000000: generate it, or make it smaller"
    ]


def test_a_long_module_is_found_but_generated_code_is_not(tmp_path: Path):
    text = '"""Does much.\n\nWhy one file: one class.\n"""\n' + "pass\n" * 597
    assert findings(tmp_path, "long.py", text) == ["long.py: 601 lines, at most 600: split it by idea"]
    assert findings(tmp_path, "long_pb2.py", text) == []


@pytest.mark.parametrize(
    "docstring", ['"""Does much."""', '"""Why one file:\n"""', "# Why one file: one class."]
)
def test_a_module_above_400_lines_says_why_it_is_one_file(tmp_path: Path, docstring: str):
    (finding,) = findings(tmp_path, "long.py", docstring + "\n" + "pass\n" * 400)
    assert "above 400 only with a reason" in finding


def test_a_module_above_400_lines_may_stand_with_its_reason(tmp_path: Path):
    text = '"""Does much.\n\nWhy one file: one class reads and writes the same registers.\n"""\n'
    assert findings(tmp_path, "long.py", text + "pass\n" * 596) == []
    assert findings(tmp_path, "short.py", "pass\n" * 400) == []


@pytest.mark.parametrize("name", ["bus-scan.added.md", "x.removed.md", "README.md", "_template.md"])
def test_a_fragment_of_the_changelog_may_stand(tmp_path: Path, name: str):
    assert findings(tmp_path, f"changes/{name}", "A bus can be scanned.\n") == []


@pytest.mark.parametrize(
    "name", ["bus-scan.md", "bus_scan.added.md", "bus-scan.feature.md", "12.added.txt", "a.py"]
)
def test_a_misnamed_fragment_is_found(tmp_path: Path, name: str):
    (finding,) = findings(tmp_path, f"changes/{name}", "A bus can be scanned.\n")
    assert "a fragment is named <slug>.<added|changed|fixed|removed>.md" in finding


def test_an_empty_fragment_is_found(tmp_path: Path):
    assert findings(tmp_path, "changes/x.added.md", "\n") == [
        "changes/x.added.md: the fragment is empty: say what changes for a user"
    ]


def test_the_types_of_fragments_are_those_that_towncrier_knows():
    settings = nox.project.load_toml(Path(__file__).resolve().parents[2] / "pyproject.toml")
    for kind in settings["tool"]["towncrier"]["type"]:
        assert check_tree.FRAGMENT.fullmatch(f"x.{kind['directory']}.md")
    assert check_tree.FRAGMENT.pattern.count("|") + 1 == len(settings["tool"]["towncrier"]["type"])


def test_a_file_that_is_not_text_is_passed_over(tmp_path: Path):
    (tmp_path / "picture.png").write_bytes(b"\x89PNG\xff\xfe")
    assert list(check_tree.examine(tmp_path / "picture.png")) == []


def test_this_repository_is_clean(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.undo()
    assert [finding for path in check_tree.tracked_files() for finding in check_tree.examine(path)] == []
