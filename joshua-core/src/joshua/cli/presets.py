"""The presets that come with the core, as their header comments describe them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).resolve().parent.parent / "presets"
SUFFIX = ".pbtxt"

_MODE = re.compile(r"^general \{.*?\bmode: MODE_(\w+)", re.DOTALL | re.MULTILINE)
_EXTRA = re.compile(r"([\w-]+)\[(\w+)\]")
_SECTION = re.compile(r"^(?P<title>[A-Z]\w+):\s+(?P<text>.*)$")


@dataclass(frozen=True)
class Preset:
    """One preset.

    Attributes:
        name: file name without its suffix.
        text: content of the file.
        mode: operation mode without its prefix, such as ``TELEOPERATE``.
        summary: first sentence of the header comment.
        sections: lines of the header comment by their title: Needs, Plugins, Run, Change.
    """

    name: str
    text: str
    mode: str
    summary: str
    sections: Mapping[str, tuple[str, ...]]

    @property
    def plugins(self) -> str:
        """The distributions that the preset needs, as in its header."""
        return " ".join(self.sections.get("Plugins", ()))

    @property
    def required(self) -> tuple[str, ...]:
        """The distributions without which the preset does not run."""
        named = [part.strip() for part in self.plugins.split(",")]
        return tuple(part.partition("[")[0] for part in named if "(optional" not in part)

    @property
    def extras(self) -> tuple[tuple[str, str], ...]:
        """Distributions of which the preset needs an extra, with its name."""
        return tuple(_EXTRA.findall(self.plugins))


def preset_names() -> list[str]:
    """List the names of all presets, sorted."""
    return sorted(path.stem for path in FOLDER.glob(f"*{SUFFIX}"))


def read_preset(name: str) -> Preset:
    """Read one preset. Raises FileNotFoundError."""
    text = (FOLDER / f"{name}{SUFFIX}").read_text(encoding="utf-8")
    mode = _MODE.search(text)
    summary, sections = _header(text)
    return Preset(name, text, mode.group(1) if mode else "", summary, sections)


def read_presets() -> list[Preset]:
    """Read every preset, sorted by name."""
    return [read_preset(name) for name in preset_names()]


def _header(text: str) -> tuple[str, dict[str, tuple[str, ...]]]:
    """Split the comment at the top of a preset into its summary and its titled sections."""
    lines = []
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.removeprefix("#").removeprefix(" "))
    end_of_summary = lines.index("") if "" in lines else len(lines)
    sections: dict[str, list[str]] = {}
    current: list[str] = []
    for line in lines[end_of_summary:]:
        if match := _SECTION.match(line):
            current = sections.setdefault(match["title"], [])
            current.append(match["text"])
        elif line.startswith("  "):
            current.append(line.strip())
        else:
            current = []
    return " ".join(lines[:end_of_summary]), {title: tuple(rows) for title, rows in sections.items()}
