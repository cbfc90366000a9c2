"""Uploads in a run: a run that only uploads, and uploads of the episodes that a recorder keeps."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from joshua.api import NodeContext

from joshua_dataset.cloud.errors import RemoteError, StoppedError
from joshua_dataset.cloud.store import Store, Tally
from joshua_dataset.reader import Dataset, DatasetError
from joshua_dataset.settings import StoreSettings

#: Heartbeat timeout of an upload: the libraries of remotes wait long for a network.
HANG_S = 600.0


class UploadRun:
    """Behaviour of ``DATA_STORE_UPLOAD``, which ends the run when the upload is done.

    Args:
        context: of the node; settings: of the block.
    """

    def __init__(self, context: NodeContext, settings: StoreSettings) -> None:
        self._context, self._settings = context, settings
        self._store: Store | None = None

    def configure(self) -> None:
        """Check that the data set and the library exist. Raises EpisodeError, DatasetError."""
        Dataset.read(Path(self._settings.folder))
        self._store = _store_of(self._settings.remote)

    def activate(self) -> None:
        """Start the thread."""
        self._context.spawn_thread(self._upload, name="upload", hang_after_s=HANG_S)

    def deactivate(self) -> None:
        """Do nothing: the thread ends by itself."""

    def cleanup(self) -> None:
        """Do nothing: nothing is open."""

    def _upload(self) -> None:
        from joshua_dataset.cloud.upload import upload

        assert self._store is not None
        tally = tally_of(self._context, lambda: self._context.stopping)
        try:
            done = upload(Path(self._settings.folder), self._store, tally)
        except StoppedError:
            self._context.log.warning(
                "%d of %d files are uploaded; start the same run again to upload the rest",
                tally.done_files,
                tally.files,
            )
        except (RemoteError, DatasetError) as error:
            self._context.fail_with(error)
        else:
            self._context.end_run(str(done))


class Uploads:
    """Uploads the episodes of a recording, each when it is kept or all at the end, while it continues.

    Args:
        context: of the node; settings: of the block.
    """

    def __init__(self, context: NodeContext, settings: StoreSettings) -> None:
        self._context, self._settings = context, settings
        self._store: Store | None = None
        self._news = threading.Event()
        self._lock = threading.Lock()
        self._has_kept = False

    def configure(self) -> None:
        """Check that the library of the remote is installed. Raises RemoteError."""
        self._store = _store_of(self._settings.remote)

    def activate(self) -> None:
        """Start the thread."""
        if self._settings.upload == "each":
            self._context.spawn_thread(self._follow, name="uploads", hang_after_s=HANG_S)

    def kept(self) -> None:
        """Note that an episode is complete on the disk (on any thread)."""
        self._has_kept = True
        self._news.set()

    def finish(self) -> None:
        """Upload the remaining files after the recorder has ended. Raises RemoteError."""
        if not self._has_kept:
            return
        self._context.log.info(
            "uploading to %s; press Ctrl-C twice within 2 s to leave it for `joshua dataset upload`",
            self._settings.remote,
        )
        try:
            self._send(lambda: False)
        except (RemoteError, DatasetError) as error:
            folder, remote = self._settings.folder, self._settings.remote
            raise RemoteError(
                f"{error}. Every episode is in {folder}: run `joshua dataset upload {folder} {remote}`"
            ) from error

    def _follow(self) -> None:
        while not self._context.stopping:
            if not self._news.wait(0.2):
                continue
            self._news.clear()
            try:
                self._send(lambda: self._context.stopping)
            except StoppedError:
                return
            except (RemoteError, DatasetError) as error:
                self._context.log.warning("%s; the recording continues, and the next upload retries", error)

    def _send(self, stopping: Callable[[], bool]) -> None:
        from joshua_dataset.cloud.upload import upload

        assert self._store is not None
        with self._lock:  # the thread of the last episode may still be uploading
            done = upload(Path(self._settings.folder), self._store, tally_of(self._context, stopping))
        self._context.log.info("%s", done)


def tally_of(context: NodeContext, stopping: Callable[[], bool]) -> Tally:
    """Return a tally that reports to the run."""
    shown = 1e6

    def show(tally: Tally) -> None:
        if tally.bytes:
            context.progress(
                "upload",
                round(tally.done_bytes / shown, 3),
                round(tally.bytes / shown, 3),
                unit="MB",
                rate=round(tally.rate / shown, 3),
                remaining_s=tally.remaining_s,
            )

    return Tally(show, stopping, lambda text: context.log.warning("%s", text))


def _store_of(remote: str) -> Store:
    from joshua_dataset.cloud.copies import store_of

    return store_of(remote)
