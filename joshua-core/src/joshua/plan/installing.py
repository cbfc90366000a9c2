"""How to install a distribution: from the origin of this core, never by a name that an index may lack.

In a clone, no distribution of this project is installed from a package index, where its names may belong to
others. An index is offered only if the core itself came from one.
"""

from __future__ import annotations

import json
import os
import re
import shlex
from collections.abc import Iterable
from functools import cache
from pathlib import Path

CORE = "joshua-core"
PREFIX = "joshua-"


@cache
def origin(distribution: str = CORE) -> str | None:
    """URL that a distribution was installed from (PEP 610); "" for an index, None if it is not installed."""
    from importlib import metadata

    try:
        record = metadata.distribution(distribution).read_text("direct_url.json")
        return str(json.loads(record)["url"]) if record else ""
    except (metadata.PackageNotFoundError, ValueError, KeyError):
        return None


@cache
def clone() -> Path | None:
    """The root of the clone that this core is installed from; None if it comes from a package."""
    from urllib.parse import unquote, urlsplit

    places = [Path(__file__).resolve().parents[4]]
    if (url := urlsplit(origin() or "")).scheme == "file":
        places.append(Path(unquote(url.path)).parent)
    return next((at for at in places if (at / "run").is_file() and (at / "joshua-plugins").is_dir()), None)


def install(distribution: str, extra: str = "") -> str:
    """The command that installs a distribution, with an extra; or what to do if there is none."""
    root, wanted = clone(), f"{distribution}[{extra}]" if extra else distribution
    if not distribution.startswith(PREFIX) or (root is None and origin() == ""):
        return f"pip install {shlex.quote(_origin_of(distribution) or wanted)}"
    if root is None:
        return f"install {wanted} from the source that {CORE} was installed from"
    if not _folder(root, distribution).is_dir():
        return f"this clone has no joshua-plugins/{distribution.removeprefix(PREFIX)}"
    if distribution == CORE:
        return f"pip install -e {_shown(root / wanted)}"
    return f"{_shown(root / 'run')} --with {shlex.quote(wanted.removeprefix(PREFIX))}"


def has_extra(distribution: str, extra: str) -> bool:
    """Whether all that an extra of an installed distribution brings is installed."""
    from importlib import metadata

    try:
        listed = metadata.requires(distribution) or []
        wanted = [item for item in listed if re.search(rf"extra == ['\"]{extra}['\"]", item)]
        found = [match for item in wanted if (match := re.match(r"([\w.-]+)(?:\[(\w+)\])?", item))]
        return all(
            metadata.version(name) and (not more or has_extra(name, more))
            for name, more in (match.groups() for match in found)
        )
    except metadata.PackageNotFoundError:
        return False


def requires(distribution: str) -> str:
    """The end of a message about a missing plugin: its name, and how to install it."""
    return f"requires the plugin {distribution}, which is not installed: {install(distribution)}"


def is_offered(distribution: str) -> bool:
    """Whether a distribution of this name can be installed, as far as known on this machine."""
    return clone() is None or is_cloned(distribution) or not distribution.startswith(PREFIX)


def hints(distributions: Iterable[str]) -> list[str]:
    """One line with the command for several distributions, and one for those that do not exist."""
    named = list(distributions)
    wanted = [name for name in named if is_offered(name)]
    lines = [f"not available yet: {', '.join(sorted(set(named) - set(wanted)))}"] if wanted != named else []
    root = clone()
    if wanted and root is not None:
        names = ",".join(name.removeprefix(PREFIX) for name in wanted)
        return [f"install what is missing: {_shown(root / 'run')} --with {names}", *lines]
    if wanted and origin() == "":
        return [f"install what is missing: pip install {' '.join(wanted)}", *lines]
    return lines


def reinstall(distribution: str) -> str:
    """The command that reinstalls a broken distribution."""
    if is_cloned(distribution):
        return f"pip install --force-reinstall --no-deps {target(distribution)}"
    return install(distribution).replace("pip install", "pip install --force-reinstall", 1)


def upgrade(distribution: str) -> str:
    """The command that updates a distribution to match the core."""
    if is_cloned(distribution):
        return f"git pull && {install(distribution)}"
    return install(distribution).replace("pip install", "pip install --upgrade", 1)


def target(distribution: str) -> str:
    """The argument of pip for a distribution: its folder in the clone, else its name."""
    root = clone()
    return f"-e {_shown(_folder(root, distribution))}" if root and is_cloned(distribution) else distribution


def is_cloned(distribution: str) -> bool:
    """Whether the clone of this core contains a distribution."""
    root = clone()
    return root is not None and distribution.startswith(PREFIX) and _folder(root, distribution).is_dir()


def _origin_of(distribution: str) -> str:
    """Path or URL that a third party's distribution was installed from; "" for an index or none."""
    url = (origin(distribution) or "") if not distribution.startswith(PREFIX) else ""
    return url.removeprefix("file://")


def _folder(root: Path, distribution: str) -> Path:
    if distribution == CORE:
        return root / CORE
    return root / "joshua-plugins" / distribution.removeprefix(PREFIX)


def _shown(path: Path) -> str:
    """A path for the user to type: relative if it is below the current folder, else absolute."""
    try:
        relative = os.path.relpath(path)
    except (OSError, ValueError):
        return shlex.quote(str(path))
    return shlex.quote(str(path) if relative.startswith("..") else f"./{relative}")
