"""The presets page, made from the header comments of the files."""

from __future__ import annotations

from joshua.cli.commands.presets import MODES
from joshua.cli.presets import Preset, read_presets

from reference.markdown import code

HEAD = """# Presets

Configurations to run as they are or to start from: `joshua presets` lists them,
`joshua new my_robot --from PRESET` copies one into the current folder.
"""


def presets_page() -> str:
    """Makes the page, one section for each operation mode."""
    presets = read_presets()
    lines = [HEAD]
    for mode in MODES:
        lines += [f"## MODE_{mode}", ""]
        for preset in presets:
            if preset.mode == mode:
                lines += preset_lines(preset)
    return "\n".join(lines)


def preset_lines(preset: Preset) -> list[str]:
    """Makes the paragraph of one preset."""
    needs = "; ".join(preset.sections["Needs"])
    change = "; ".join(preset.sections["Change"])
    return [
        f"### {preset.name}",
        "",
        preset.summary,
        "",
        f"- Needs: {needs}",
        f"- Plugins: {preset.plugins}",
        f"- Run: {code(preset.sections['Run'][0])}",
        f"- Change first: {change}",
        "",
    ]
