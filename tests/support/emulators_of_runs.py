"""Faults of emulators that a run under test has started itself, with ``--emulate``."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from joshua_emulator import EmulatorProcess


def bring_about(said: str, node: str, kind: str, value: float | None = None, **settings: Any) -> None:
    """Brings a fault about, once the test has seen that the run is ready for it.

    A fault with ``at_s`` on the command line counts from the start of its emulator, and how long the nodes
    take from there is the machine's affair.

    Args:
        said: what the run has printed; it names the place of each emulator.
    """
    endpoint = re.search(rf"emulated: {node} at (\S+)", said)
    assert endpoint is not None, said
    (control,) = [folder / "control.sock" for folder in Path(endpoint[1]).parents if has_control(folder)]
    emulator = EmulatorProcess((), {"root": control.parent})
    emulator.ready = {"control": str(control)}
    emulator.fault(kind, value, **settings)
    emulator.close()


def has_control(folder: Path) -> bool:
    """Whether an emulator is asked in this folder."""
    return (folder / "control.sock").exists()
