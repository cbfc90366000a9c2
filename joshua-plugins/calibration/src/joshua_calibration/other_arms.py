"""Whose calibration a device holds: the other arms of a configuration, and the files beside it.

Calibrating again would destroy two good calibrations if only the ports of two arms are swapped.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.api.calibration import ArmCalibration
from joshua.tools import FileRefused, kept_calibrations, load
from pydantic import ValidationError

if TYPE_CHECKING:
    from joshua.tools import LoadedConfig

#: Files beside the configuration that are read at most, and the size of the largest one.
MAX_FILES = 100
MAX_BYTES = 1_000_000


@dataclass(frozen=True)
class Fit:
    """The entry whose values a device holds.

    Attributes:
        cause: whose values they are, for a message; remedy: what to do, as lines.
    """

    cause: str
    remedy: tuple[str, ...]


@dataclass(frozen=True)
class _Entry:
    """A calibration in reach; ``file`` is "" for one of the configuration itself."""

    node_name: str
    file: str
    calibration: ArmCalibration


def fitting_entry(
    source: str, overrides: Sequence[str], node_name: str, fits: Callable[[ArmCalibration], bool]
) -> Fit | None:
    """Find the other calibration in reach that a device holds exactly, and tell what to do about it.

    Args:
        source: the configuration, "" for a driver without one; overrides: its ``--set`` options.
        node_name: of the arm whose own calibration does not match.
        fits: whether a calibration has exactly the values of the device.
    """
    if not source:
        return None
    loaded = load(source, overrides)
    own = [arm for arm in loaded.config.calibration.arms if arm.node_name == node_name]
    known = [entry.calibration for entry in _valid("", {node_name: own[0]} if own else {})]
    for entry in _in_reach(source, loaded):
        # A file that the configuration includes has its own entry, too.
        is_own = entry.node_name == node_name and entry.calibration in known
        if not is_own and fits(entry.calibration):
            return _fit(source, loaded, node_name, entry)
    return None


def _in_reach(source: str, loaded: LoadedConfig) -> Iterator[_Entry]:
    """The entries of the configuration, then those of the files beside it."""
    yield from _valid("", {arm.node_name: arm for arm in loaded.config.calibration.arms})
    folder = Path(source).parent
    paths = sorted({*folder.glob("*.pbtxt"), *(folder / "calibration").glob("*.pbtxt")})
    for path in paths[:MAX_FILES]:
        try:
            if path.stat().st_size > MAX_BYTES or "homing_offset" not in path.read_text("utf-8"):
                continue
            arms = kept_calibrations(path)
        except (OSError, ValueError, FileRefused):
            continue  # a file that is none of this run's
        yield from _valid(str(path), arms)


def _valid(file: str, arms: Mapping[str, Any]) -> Iterator[_Entry]:
    for name, block in arms.items():
        try:
            calibration = ArmCalibration.from_block(block)
        except ValidationError:
            continue
        yield _Entry(name, file, calibration)


def _fit(source: str, loaded: LoadedConfig, node_name: str, entry: _Entry) -> Fit:
    cause = f"these are the values of {entry.node_name}"
    if entry.file:
        cause += f" in {entry.file}"
    if entry.node_name == node_name:
        include = os.path.relpath(entry.file, Path(source).parent)
        return Fit(cause, (f'Include that file: write include: "{include}" into {source}',))
    swaps = [] if entry.file else _swaps(loaded, node_name, entry.node_name)
    if not swaps:
        return Fit(
            cause, (f"Connect {node_name}, or correct its port. Both calibrations are good: keep them.",)
        )
    words = " ".join(f"--set {shlex.quote(f'{field}={value}')}" for field, value in swaps)
    return Fit(
        f"{cause}: swap the two ports",
        (
            f"Both calibrations are good: keep them. Write into {source}:",
            *(f"  {field}: {_quoted(value)}" for field, value in swaps),
            f"or try it first: joshua --config {shlex.quote(source)} {words}",
        ),
    )


def _swaps(loaded: LoadedConfig, first: str, second: str) -> list[tuple[str, str]]:
    """The fields that name the ports of two arms, each with the value of the other arm's.

    Empty if the two name their ports in different ways.
    """
    blocks: dict[str, tuple[str, dict[str, str]]] = {}
    for index, action in enumerate(loaded.config.robot.actions):
        for field, content in action.ListFields():
            port = _port(content)
            if port:
                path = f"robot.actions[{index}].{field.name}.comm.serial"
                blocks[action.node.node_name] = (path, port)
    if first not in blocks or second not in blocks:
        return []
    (first_path, first_port), (second_path, second_port) = blocks[first], blocks[second]
    if set(first_port) != set(second_port):
        return []
    names = [name for name in first_port if first_port[name] != second_port[name]]
    return [
        *((f"{first_path}.{name}", second_port[name]) for name in names),
        *((f"{second_path}.{name}", first_port[name]) for name in names),
    ]


def _port(content: Any) -> dict[str, str]:
    """The fields of a block that name its serial port."""
    comm = getattr(content, "comm", None)
    serial = getattr(comm, "serial", None)
    names = ("port", "serial_number", "vid_pid")
    return {name: getattr(serial, name) for name in names if getattr(serial, name, "")}


def _quoted(value: str) -> str:
    escaped = value.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
