"""A full memory: said before it is full where that is known, and with the setting that halves it."""

from __future__ import annotations

import errno
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from joshua_training.run_folder import RunError, RunFolder

#: What PyTorch says if a processor has no memory left, or an accelerator whose error has no class of its
#: own, and JAX of any device.
_FULL = ("can't allocate memory", "out of memory", "RESOURCE_EXHAUSTED")


@contextmanager
def remedied(halves: str, folder: RunFolder | None = None) -> Iterator[None]:
    """Turn an error about a full memory into a RunError.

    Args:
        halves: what halves the memory of the training, such as ``halve batch_size``.
        folder: of the run, which says how to continue.
    """
    try:
        yield
    except Exception as error:
        if not is_out_of_memory(error):
            raise
        then = f", and {folder.then}" if folder is not None else ""
        raise RunError(f"the memory is full: {halves}{then}") from error


def is_out_of_memory(error: BaseException) -> bool:
    """Whether an error of Python, NumPy, PyTorch or JAX says that the memory is full."""
    return (
        isinstance(error, MemoryError)
        or type(error).__name__ == "OutOfMemoryError"
        or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
        or (isinstance(error, RuntimeError) and any(said in str(error) for said in _FULL))
    )


def require(needed: int, purpose: str, halves: str, facts: Path = Path("/proc/meminfo")) -> None:
    """Refuse arrays that do not fit into the free memory, which Linux would grant until they are filled.

    Args:
        needed: bytes; purpose: of the arrays; halves: see ``remedied``.

    Raises:
        RunError: less is free.
    """
    free = _available(facts)
    if free is not None and needed > free:
        raise RunError(
            f"{purpose} needs {needed / 1e9:.1f} GB, and {free / 1e9:.1f} GB of memory are free: {halves}"
        )


def _available(facts: Path) -> int | None:
    try:
        found = re.search(r"^MemAvailable:\s+(\d+) kB", facts.read_text(encoding="utf-8"), re.MULTILINE)
    except OSError:
        return None
    return int(found.group(1)) * 1024 if found else None
