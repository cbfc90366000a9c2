"""Work on a cluster that fails: what ends a run because of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from joshua_jobs.executor import JobError

from joshua_training.run_folder import LibraryMissing, RunError, RunFolder


@contextmanager
def on_cluster(folder: RunFolder | None = None) -> Iterator[None]:
    """Turn a JobError into a RunError.

    Args:
        folder: of a run that can be continued.
    """
    try:
        yield
    except JobError as error:
        kind = LibraryMissing if error.exit_code == LibraryMissing.exit_code else RunError
        is_saved = folder is not None and folder.checkpoints()
        then = ". With resume_run, it continues after the last checkpoint" if is_saved else ""
        raise kind(f"{error}{then}") from error
