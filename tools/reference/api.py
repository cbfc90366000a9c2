"""The reference of the public Python API: every name of ``joshua.api``, by section."""

from __future__ import annotations

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
