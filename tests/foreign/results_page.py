"""The results of the trials as tables of the documentation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from foreign_models import Trial

PAGE = Path(__file__).resolve().parents[2] / "docs" / "guides" / "foreign-models.md"

BEGIN = "<!-- results: written by nox -s models -- --write-page -->\n"
END = "<!-- end of the results -->\n"


def share(trials: Sequence[Trial]) -> float:
    """Return the share of driven models among those with a joint to drive."""
    counts = Counter(trial.outcome for trial in trials)
    return counts["driven"] / (counts["driven"] + counts["refused"])


def tables(trials: Sequence[Trial], versions: Mapping[str, str]) -> str:
    """Return the section of the page: models by package, refused ones, and actuators that are left out."""
    tried = [trial for trial in trials if trial.outcome in ("driven", "refused")]
    lines = [
        f"**{share(trials):.0%} of {len(tried)} models are driven.**\n",
        "| Package | Version | Models | Driven | Refused | Without a joint to drive | Parts of models |",
        "|---|---|---|---|---|---|---|",
    ]
    for package, version in versions.items():
        counts = Counter(trial.outcome for trial in trials if trial.package == package)
        cells = [counts["driven"] + counts["refused"], counts["driven"], counts["refused"]]
        cells += [counts["nothing to drive"], counts["fragment"]]
        lines.append(f"| `{package}` | {version} | {' | '.join(map(str, cells))} |")
    refused = [trial for trial in trials if trial.outcome == "refused"]
    if refused:
        lines += ["", "| Refused model | Why |", "|---|---|"]
        lines += [f"| `{trial.path}` | {trial.reasons[0]} |" for trial in refused]
    reasons = Counter(refusal.reason for trial in trials for refusal in trial.refusals)
    lines += ["", "| An actuator is left out because it … | Actuators |", "|---|---|"]
    lines += [f"| {reason} | {count} |" for reason, count in sorted(reasons.items())]
    return "\n".join(lines) + "\n"


def section(page: str) -> str:
    """Return the section of the results of a page. Raises ValueError if it has none."""
    return page[page.index(BEGIN) + len(BEGIN) : page.index(END)]


def rows_by_package(results: str) -> dict[str, list[str]]:
    """Return the cells of the first table of a section by package: version, then the numbers of models."""
    rows = [line.strip("| ").split(" | ") for line in results.splitlines() if line.startswith("| `")]
    return {cells[0].strip("`"): cells[1:] for cells in rows if len(cells) == 7}


def replaced(page: str, results: str) -> str:
    """Return a page with other results."""
    return page.replace(BEGIN + section(page) + END, BEGIN + results + END)
