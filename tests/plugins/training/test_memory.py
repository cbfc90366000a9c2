"""A full memory names the setting that halves it."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest
from joshua_training.memory import remedied, require
from joshua_training.run_folder import RunError, RunFolder


class OutOfMemoryError(RuntimeError):
    """The class that PyTorch raises on a GPU, by its name."""


@pytest.mark.parametrize(
    "error",
    [
        MemoryError("Unable to allocate 80 GiB"),
        OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB."),
        RuntimeError("[enforce fail at alloc_cpu.cpp:117] DefaultCPUAllocator: can't allocate memory"),
        RuntimeError("MPS backend out of memory (MPS allocated: 17.00 GB, max allowed: 18.13 GB)"),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        RuntimeError("RESOURCE_EXHAUSTED: Out of memory allocating 17592186044416 bytes."),
    ],
    ids=lambda error: type(error).__name__,
)
def test_a_full_memory_has_a_remedy(error: Exception) -> None:
    with (
        pytest.raises(RunError, match="the memory is full: halve batch_size") as raised,
        remedied("halve batch_size"),
    ):
        raise error
    assert raised.value.__cause__ is error


def test_the_run_says_how_to_continue_at_the_time_of_the_error(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "run", {})

    @remedied("halve it", folder)
    def fill(steps: int) -> None:
        if steps:
            folder.save(steps, {"weights": b""})
        raise MemoryError

    with pytest.raises(RunError, match="halve it, and start again; the run has no checkpoint yet"):
        fill(0)
    with pytest.raises(RunError, match="halve it, and continue with resume_run; the last checkpoint is"):
        fill(1)


def test_other_errors_stay_themselves() -> None:
    with pytest.raises(RuntimeError, match="shapes differ"), remedied("halve batch_size"):
        raise RuntimeError("shapes differ")


def test_what_does_not_fit_is_refused_before_it_is_filled(tmp_path: Path) -> None:
    facts = tmp_path / "meminfo"
    facts.write_text(
        "MemTotal:       16000000 kB\nMemFree:          300000 kB\nMemAvailable:    2000000 kB\n"
    )
    require(2_000_000_000, "the replay buffer", "halve buffer_size", facts)
    with pytest.raises(
        RunError,
        match=r"the replay buffer needs 3\.0 GB, and 2\.0 GB of memory are free: halve buffer_size",
    ):
        require(3_000_000_000, "the replay buffer", "halve buffer_size", facts)
    require(10**15, "the replay buffer", "halve buffer_size", tmp_path / "absent")
