"""Imports at first use, and those that are left out."""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from types import ModuleType
from typing import Any


def lazy_names(
    package: str, *tables: Mapping[str, Iterable[str]]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` for a module.

    Args:
        package: ``__name__`` of the module; tables: names by their module, including submodules.
    """
    module_of = {name: module for table in tables for module, names in table.items() for name in names}

    def get(name: str) -> Any:
        if name not in module_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = importlib.import_module(module_of[name])
        value = getattr(module, name, None) or importlib.import_module(f"{module_of[name]}.{name}")
        setattr(sys.modules[package], name, value)
        return value

    return get, lambda: sorted({*vars(sys.modules[package]), *module_of})


def without_pydantic_plugins() -> None:
    """Leave out pydantic's search for plugins in all installed packages: no settings model uses any."""
    if (loader := "pydantic.plugin._loader") not in sys.modules:
        no_plugins: Any = ModuleType(loader)
        no_plugins.get_plugins = tuple
        sys.modules[loader] = no_plugins


def sections(path: str) -> dict[str, dict[str, tuple[str, ...]]]:
    """Read the names of a lazy module from its stub, which type checkers also read.

    Args:
        path: ``__file__`` of the module.

    Returns:
        Names by their heading (a comment) and their module.
    """
    found: dict[str, dict[str, tuple[str, ...]]] = {}
    with open(f"{path.removesuffix('.py')}.pyi", encoding="utf-8") as stub:  # noqa: PTH123 (hot, and no Path yet)
        lines = stub.read().splitlines()
    for line in lines:
        if heading := re.fullmatch(r"# (?!ruff)(.+)", line):
            modules = found.setdefault(heading[1], {})
        elif name := re.fullmatch(r"from (\S+) import (\w+) as \2", line):
            modules[name[1]] = (*modules.get(name[1], ()), name[2])
    return found
