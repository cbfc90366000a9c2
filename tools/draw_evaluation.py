"""Photographs the report of an evaluation: ``draw_evaluation.py REPORT.html``. It needs chromium."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

PICTURE = Path(__file__).resolve().parent.parent / "docs" / "images" / "evaluation-report.webp"
WIDTH, HEIGHT = 1040, 1380


def main(arguments: list[str]) -> int:
    """Writes the picture."""
    if len(arguments) != 1 or not Path(arguments[0]).is_file():
        sys.stderr.write("name the report.html of an evaluation\n")
        return 2
    with tempfile.TemporaryDirectory() as folder:
        shot = Path(folder) / "page.png"
        options = ("--headless", "--no-sandbox", "--hide-scrollbars", f"--window-size={WIDTH},{HEIGHT}")
        address = Path(arguments[0]).resolve().as_uri()
        command = ["chromium", *options, "--virtual-time-budget=3000", f"--screenshot={shot}", address]
        subprocess.run(command, check=True, capture_output=True, timeout=60)
        with Image.open(shot) as page:
            page.convert("RGB").save(PICTURE, quality=70, method=6)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
