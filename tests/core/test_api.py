"""The public API: every name is there, documented and loaded late; plugins use nothing else of the core."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import joshua.api
import joshua.tools
import pytest

ROOT = Path(__file__).resolve().parents[2]
MODULE_OF = {
    name: module
    for modules in joshua.api.SECTIONS.values()
    for module, names in modules.items()
    for name in names
}
FAMILIES = {
    f"joshua.api.{info.name}": importlib.import_module(f"joshua.api.{info.name}")
    for info in pkgutil.iter_modules(joshua.api.__path__)
}
PLUGINS = sorted(path for path in ROOT.glob("joshua-plugins/*/src/*") if (path / "__init__.py").is_file())
EXAMPLES = sorted(path for path in ROOT.glob("docs/examples/*/src/*") if (path / "__init__.py").is_file())

# What a plugin may import of the core; the modules that protobuf generates may import the schema, too.
PUBLIC = ("joshua.api", "joshua.features", "joshua.messages", "joshua.testing", "joshua.tools")


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """Yields line and module of every import of the core in a file, those for type checkers included."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module == "joshua":
            yield from ((node.lineno, f"joshua.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.lineno, node.module
        elif (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and node.value.startswith("joshua.")
        ):
            module, colon, _ = node.value.partition(":")
            if colon:  # an import string
                yield node.lineno, module


def is_public(module: str) -> bool:
    return module.startswith(tuple(f"{name}." for name in PUBLIC)) or module in PUBLIC


@pytest.mark.parametrize("package", [*PLUGINS, *EXAMPLES], ids=lambda path: path.name)
def test_a_plugin_imports_only_what_is_public(package: Path):
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path in sorted(package.rglob("*.py"))
        for line, name in imports(path)
        if name.split(".")[0] == "joshua"
        and not is_public(name)
        and not (path.stem.endswith("_pb2") and name.startswith("joshua.schema"))
    ]
    assert wrong == []


def test_no_name_stands_twice():
    listed = [names for modules in joshua.api.SECTIONS.values() for names in modules.values()]
    assert sum(map(len, listed)) == len(MODULE_OF)


def test_the_names_that_most_plugins_use_stay_on_one_page():
    assert len(MODULE_OF) <= 44, "a rarer name belongs in a module of joshua.api"


@pytest.mark.parametrize("family", FAMILIES)
def test_the_docstring_of_the_api_names_each_of_its_modules(family: str):
    assert f"``{family.removeprefix('joshua.api.')}``" in (joshua.api.__doc__ or "")
    values = {name: value for name, value in vars(FAMILIES[family]).items() if not name.startswith("__")}
    assert values
    assert not values.keys() & MODULE_OF.keys()
    for name, value in values.items():
        if isinstance(value, type) or inspect.isfunction(value):
            assert (value.__doc__ or "").strip(), f"{family}.{name} has no docstring"


@pytest.mark.parametrize("name", MODULE_OF)
def test_every_name_is_there_and_says_what_it_is(name: str):
    value = getattr(joshua.api, name)
    if isinstance(value, type) or inspect.isfunction(value):
        assert (value.__doc__ or "").strip(), f"joshua.api.{name} has no docstring"


def test_every_line_of_the_stubs_is_a_name_under_a_heading():
    for package in (joshua.api, joshua.tools):
        stub = Path(package.__file__ or "").with_suffix(".pyi").read_text(encoding="utf-8")
        listed = [
            name for modules in package.SECTIONS.values() for names in modules.values() for name in names
        ]
        assert stub.count("\nfrom ") == len(listed)
        assert len(set(listed)) == len(listed)


def test_an_unknown_name_is_an_ordinary_error():
    with pytest.raises(AttributeError, match="has no attribute 'Servo'"):
        joshua.api.Servo  # type: ignore[attr-defined]  # noqa: B018


def test_describing_a_plugin_imports_no_driver():
    code = (
        "import sys, joshua.api; from joshua.api import ActuatorSpec, hookimpl; "
        "import joshua.api.emulation, joshua.api.modes, joshua.api.simulation; "
        "heavy = {'numpy', 'pydantic', 'zenoh', 'cyclonedds', 'joshua.devices.actuator'}; "
        "sys.exit(' '.join(sorted(heavy & set(sys.modules))) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_modules_named_in_the_table_exist():
    for modules in joshua.api.SECTIONS.values():
        for module in modules:
            importlib.import_module(module)
