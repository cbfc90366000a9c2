"""Pin requirements to the oldest versions that they allow, to test that these still serve."""

from __future__ import annotations

from collections.abc import Iterable

from packaging.requirements import Requirement
from packaging.version import Version


def oldest_versions(requirements: Iterable[str]) -> list[str]:
    """Return a pin for each requirement with a lower bound; other requirements stay as they are.

    Args:
        requirements: as in pyproject.toml. Of several for one distribution, the highest bound counts.
    """
    pins: dict[str, Version] = {}
    others: list[str] = []
    for text in requirements:
        requirement = Requirement(text)
        if requirement.marker is not None and not requirement.marker.evaluate():
            continue
        bounds = [Version(part.version) for part in requirement.specifier if part.operator == ">="]
        if not bounds:
            others.append(text)
            continue
        name = f"{requirement.name}[{','.join(sorted(requirement.extras))}]".replace("[]", "")
        pins[name] = max(bounds[0], pins.get(name, bounds[0]))
    return [*(f"{name}=={version}" for name, version in sorted(pins.items())), *others]
