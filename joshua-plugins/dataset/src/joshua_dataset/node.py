"""Node of a data store, which records, replays or uploads as its block says."""

from __future__ import annotations

from joshua.api import DeviceError, NodeContext, Store
from joshua.features import EpisodeError

from joshua_dataset.cloud.errors import RemoteError
from joshua_dataset.cloud.node import UploadRun, Uploads
from joshua_dataset.reader import DatasetError
from joshua_dataset.recorder import Recorder
from joshua_dataset.replayer import Replayer
from joshua_dataset.settings import StoreSettings


class DataStore(Store):
    """Behaviour of the node ``/data_store``."""

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._settings = StoreSettings.model_validate(context.spec.settings)
        operation = self._settings.operation
        self._uploads = Uploads(context, self._settings) if self._settings.upload != "manual" else None
        self._work: Recorder | Replayer | UploadRun
        if operation == "upload":
            self._work = UploadRun(context, self._settings)
        else:
            kind = Replayer if operation == "replay" else Recorder
            self._work = kind(context, self._settings, self.facts)
        if isinstance(self._work, Recorder) and self._uploads is not None:
            self._work.on_kept = self._uploads.kept

    def verb_providers(self) -> tuple[object, ...]:
        """See ``NodeBehaviour``."""
        return (self._work,)

    def configure(self) -> None:
        """See ``NodeBehaviour``. Raises DeviceError."""
        try:
            self._work.configure()
            if self._uploads is not None:
                self._uploads.configure()
        except RemoteError:
            raise  # it carries its exit code
        except (EpisodeError, DatasetError) as error:
            raise DeviceError(str(error)) from error

    def activate(self) -> None:
        """See ``NodeBehaviour``."""
        self._work.activate()
        if self._uploads is not None:
            self._uploads.activate()

    def deactivate(self) -> None:
        """See ``NodeBehaviour``."""
        self._work.deactivate()
        if self._uploads is not None:
            self._uploads.finish()

    def cleanup(self) -> None:
        """See ``NodeBehaviour``."""
        self._work.cleanup()
