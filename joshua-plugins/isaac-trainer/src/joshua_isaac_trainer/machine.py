"""Whether this machine can run Isaac Lab, and what is missing, without loading its libraries."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

#: Release of Isaac Sim, the Python version it is built for, and the driver from which on it is said to run.
RELEASES: Mapping[str, tuple[tuple[int, int], str]] = {
    "4.5": ((3, 10), "535.129.03"),
    "5.0": ((3, 11), "535.216.01"),
    "5.1": ((3, 11), "580.65.06"),
}

#: Isaac Lab 2.3, whose modules this package calls; a clone installs the version of its extension instead.
LAB, LAB_EXTENSION = (2, 3), ((0, 46), (1, 0))

#: rsl_rl of Isaac Lab 2.3.
RSL_RL = ((3, 0, 1), (4,))

#: Memory below which Isaac Sim does not start reliably.
LEAST_MEMORY_MB = 8_000

#: Code of findings that no installation of a package repairs.
UNFIT = "machine-unfit"

_ACCEPTED = ("y", "yes", "1")
_LAB_DOCS = "https://isaac-sim.github.io/IsaacLab/v2.3.0/source/setup/installation"


@dataclass(frozen=True)
class Gpu:
    """A graphics card, as the driver names it."""

    name: str
    memory_mb: int


@dataclass(frozen=True)
class Machine:
    """What counts for Isaac Lab. A version is "" if the package does not say it, None if it is not installed.

    Attributes:
        driver: version of NVIDIA's kernel driver, None without one.
        eula: whether the licence agreement of Omniverse was accepted.
    """

    system: str
    architecture: str
    python: tuple[int, int]
    isaac_sim: str | None
    isaac_lab: str | None
    rsl_rl: str | None
    driver: str | None
    gpus: tuple[Gpu, ...]
    eula: bool


@dataclass(frozen=True)
class Lack:
    """One reason why Isaac Lab cannot run here, the remedy, and the code of the finding."""

    message: str
    remedy: str
    code: str = "extra-missing"


def look() -> Machine:
    """Examine this machine."""
    version = sys.version_info
    return Machine(
        system=platform.system(),
        architecture=platform.machine(),
        python=(version[0], version[1]),
        isaac_sim=_installed("isaacsim", "isaacsim"),
        isaac_lab=_installed("isaaclab", "isaaclab"),
        rsl_rl=_installed("rsl-rl-lib", "rsl_rl"),
        driver=_driver(),
        gpus=_gpus(),
        eula=_accepted(),
    )


def lacks(machine: Machine) -> Iterator[Lack]:
    """Find what is missing, the most basic first."""
    sim = _release(machine.isaac_sim)
    if machine.system != "Linux" or machine.architecture not in ("x86_64", "aarch64"):
        yield Lack(
            f"Isaac Sim runs on Linux here, not on {machine.system} {machine.architecture}",
            "Train on a Linux machine with an NVIDIA GPU, or use BACKEND_MUJOCO",
            UNFIT,
        )
    python = ".".join(map(str, machine.python))
    if machine.isaac_sim is None:
        wanted = [release for release, (fitting, _) in RELEASES.items() if fitting == machine.python]
        remedy = (
            f"Install Isaac Sim {wanted[-1]} and Isaac Lab 2.3 into this environment: {_LAB_DOCS}"
            if wanted
            else f"Make an environment with {_pythons()}, and install both into it: {_LAB_DOCS}"
        )
        yield Lack(f"Isaac Sim is not installed for Python {python} ({sys.executable})", remedy)
    elif sim is not None and sim not in RELEASES:
        yield Lack(
            f"Isaac Sim {machine.isaac_sim} is not supported",
            f"Install Isaac Sim {' or '.join(RELEASES)}: {_LAB_DOCS}",
        )
    elif sim is not None and RELEASES[sim][0] != machine.python:
        wanted_python = ".".join(map(str, RELEASES[sim][0]))
        yield Lack(
            f"Isaac Sim {sim} requires Python {wanted_python}, and this is Python {python}",
            f"Run joshua from an environment with Python {wanted_python}",
        )
    yield from _lab_lacks(machine)
    if machine.driver is None:
        yield Lack(
            "There is no NVIDIA driver: /proc/driver/nvidia/version does not exist",
            "Install the driver, or train on another machine: BACKEND_MUJOCO needs no GPU",
            UNFIT,
        )
    elif not machine.gpus:
        yield Lack(
            f"The NVIDIA driver {machine.driver} shows no GPU",
            "Check nvidia-smi; a container needs --gpus all",
            UNFIT,
        )
    else:
        least = RELEASES.get(sim or "5.1", RELEASES["5.1"])[1]
        if _numbers(machine.driver) < _numbers(least):
            yield Lack(
                f"The NVIDIA driver is {machine.driver}, and Isaac Sim {sim or '5.1'} requires {least}",
                "Update the driver",
                UNFIT,
            )
        best = max(machine.gpus, key=lambda gpu: gpu.memory_mb)
        if best.memory_mb < LEAST_MEMORY_MB:
            yield Lack(
                f"{best.name} has {best.memory_mb} MB, and Isaac Sim requires {LEAST_MEMORY_MB} MB",
                "Train on another machine: BACKEND_MUJOCO needs no GPU",
                UNFIT,
            )
    if machine.isaac_sim is not None and not machine.eula:
        yield Lack(
            "NVIDIA's licence agreement for Omniverse is not accepted",
            "Read it, and set OMNI_KIT_ACCEPT_EULA=YES: "
            "https://docs.omniverse.nvidia.com/platform/latest/common/NVIDIA_Omniverse_License_Agreement.html",
            UNFIT,
        )


def _lab_lacks(machine: Machine) -> Iterator[Lack]:
    lab = machine.isaac_lab
    if lab is None:
        yield Lack("Isaac Lab is not installed", f"Install Isaac Lab 2.3: {_LAB_DOCS}")
    elif lab:
        found = _numbers(lab)
        fits = found[:2] == LAB or LAB_EXTENSION[0] <= found < LAB_EXTENSION[1]
        if not fits:
            yield Lack(f"Isaac Lab is {lab}, and this trainer is made for 2.3", f"Install it: {_LAB_DOCS}")
    low, high = RSL_RL
    if machine.rsl_rl is None:
        yield Lack("rsl_rl is not installed", "Install joshua-isaac-trainer[learn] into the same environment")
    elif machine.rsl_rl and not low <= _numbers(machine.rsl_rl) < high:
        yield Lack(
            f"rsl_rl is {machine.rsl_rl}, and Isaac Lab 2.3 uses 3.0.1 to 3.x",
            "Run pip install 'rsl-rl-lib>=3.0.1,<4'",
        )


def _pythons() -> str:
    by_python: dict[tuple[int, int], list[str]] = {}
    for release, (python, _) in RELEASES.items():
        by_python.setdefault(python, []).append(release)
    return " or ".join(
        f"Python {'.'.join(map(str, python))} (Isaac Sim {', '.join(releases)})"
        for python, releases in by_python.items()
    )


def _installed(distribution: str, module: str) -> str | None:
    """Return the version of a package: "" if only its module is found, as in Isaac Sim's own interpreter."""
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "" if importlib.util.find_spec(module) is not None else None


def _driver(path: Path = Path("/proc/driver/nvidia/version")) -> str | None:
    try:
        text = path.read_text(encoding="utf-8")
    except OSError:
        return None
    found = re.search(r"\s(\d+\.\d+(?:\.\d+)?)\s", text)
    return found.group(1) if found else ""


def _gpus() -> tuple[Gpu, ...]:
    query = ("nvidia-smi", "--query-gpu=name,memory.total", "--format=csv,noheader,nounits")
    try:
        done = subprocess.run(query, capture_output=True, text=True, timeout=20, check=True)
    except (OSError, subprocess.SubprocessError):
        return ()
    return gpus_of(done.stdout)


def gpus_of(text: str) -> tuple[Gpu, ...]:
    """Parse the answer of nvidia-smi: a line ``name, memory`` for each card."""
    found = []
    for line in text.splitlines():
        name, comma, memory = line.rpartition(",")
        if comma and memory.strip().isdigit():
            found.append(Gpu(name.strip(), int(memory)))
    return tuple(found)


def _accepted() -> bool:
    if os.environ.get("OMNI_KIT_ACCEPT_EULA", "").strip().lower() in _ACCEPTED:
        return True
    spec = importlib.util.find_spec("isaacsim")
    folders = [Path(place) for place in (spec.submodule_search_locations or ())] if spec else []
    # Kit keeps the answer beside itself
    for marker in (place for folder in folders for place in (folder / "kit", folder.parent / "omni")):
        try:
            first = (marker / "EULA_ACCEPTED").read_text(encoding="utf-8").partition("\n")[0]
        except OSError:
            continue
        if first.strip().lower() in _ACCEPTED:
            return True
    return False


def _release(version: str | None) -> str | None:
    numbers = _numbers(version or "")
    return ".".join(map(str, numbers[:2])) if len(numbers) > 1 else None


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version)[:3])
