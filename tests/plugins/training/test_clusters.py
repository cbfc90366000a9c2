"""Trainings whose cluster fails: exit codes, and what to do with the run."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua_jobs.executor import JobError
from joshua_training.clusters import on_cluster
from joshua_training.run_folder import LibraryMissing, RunError, RunFolder


def failure(error: JobError, folder: RunFolder | None = None) -> RunError:
    with pytest.raises(RunError) as caught, on_cluster(folder):
        raise error
    return caught.value


def test_a_run_with_a_checkpoint_can_be_continued(tmp_path: Path) -> None:
    lost = JobError("all workers are lost. Start nodes, and run the command again")
    folder = RunFolder(tmp_path)
    assert str(failure(lost)) == str(failure(lost, folder)) == str(lost)
    folder.save(4, {"weights": b"1"})
    assert str(failure(lost, folder)) == f"{lost}. With resume_run, it continues after the last checkpoint"


def test_a_missing_library_keeps_its_exit_code() -> None:
    assert failure(JobError("install it", 3)).exit_code == LibraryMissing.exit_code == 3
    assert failure(JobError("no node is left")).exit_code == 1
