"""The reference of the public Python API: every name of ``joshua.api`` and of its modules, by section."""

from __future__ import annotations

import ast
import pkgutil
from collections.abc import Iterator
from pathlib import Path

import joshua.api

_PUBLIC_MODULES = {
    "joshua.features": "what is seen and done",
    "joshua.messages": "ROS 2 messages",
    "joshua.testing": "the conformance kit",
    "joshua.tools": "for editors, dashboards and scripts",
}


def api_page() -> str:
    """Makes the page; the documentation generator reads signatures and docstrings from the sources."""
    lines = ["# Python API", "", (joshua.api.__doc__ or "").replace("``", "`").strip(), ""]
    for section, modules in joshua.api.SECTIONS.items():
        lines += [f"## {section}", ""]
        for module, names in modules.items():
            for name in names:
                lines += [f"::: {module}.{name}", ""]
    for info in pkgutil.iter_modules(joshua.api.__path__):
        purpose, members = family(Path(joshua.api.__path__[0]) / f"{info.name}.py")
        lines += [f"## joshua.api.{info.name}", "", purpose, ""]
        for module, name in members:
            lines += [f"::: {module}.{name}", ""]
    for module, title in _PUBLIC_MODULES.items():
        lines += [
            f"## {module}: {title}",
            "",
            f"::: {module}",
            "    options:",
            "      show_root_heading: false",
            "",
        ]
    return "\n".join(lines)


def family(path: Path) -> tuple[str, Iterator[tuple[str, str]]]:
    """What a module of ``joshua.api`` is for, and its names, each after the module that it is from."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    imports = (node for node in tree.body if isinstance(node, ast.ImportFrom))
    names = ((node.module or "", alias.name) for node in imports for alias in node.names)
    return ast.get_docstring(tree) or "", names
