"""Shows findings: text for people, JSON for editors."""

from joshua.config.diagnostics.json_format import render_json
from joshua.config.diagnostics.text_format import columns_of, render_text, summary, wants_color

__all__ = ["columns_of", "render_json", "render_text", "summary", "wants_color"]
