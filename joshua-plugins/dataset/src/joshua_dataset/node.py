"""The node of a data store: records or replays, as its block says."""

from __future__ import annotations

from joshua.api import DeviceError, NodeContext, Store
from joshua.features import EpisodeError

from joshua_dataset.recorder import Recorder
from joshua_dataset.replayer import Replayer
from joshua_dataset.settings import StoreSettings


class DataStore(Store):
    """Behaviour of the node ``/data_store``."""

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._settings = StoreSettings.model_validate(context.spec.settings)
        kind = Replayer if self._settings.operation == "replay" else Recorder
        self._work = kind(context, self._settings, self.facts)

    def verb_providers(self) -> tuple[object, ...]:
        """See ``NodeBehaviour``."""
        return (self._work,)

    def configure(self) -> None:
        """See ``NodeBehaviour``. Raises DeviceError."""
        if self._settings.operation == "upload":
            raise DeviceError(
                "joshua-dataset cannot upload data sets yet. Use the tool of the remote, such as `hf upload`"
            )
        try:
            self._work.configure()
        except EpisodeError as error:
            raise DeviceError(str(error)) from error

    def activate(self) -> None:
        """See ``NodeBehaviour``."""
        self._work.activate()

    def deactivate(self) -> None:
        """See ``NodeBehaviour``."""
        self._work.deactivate()

    def cleanup(self) -> None:
        """See ``NodeBehaviour``."""
        self._work.cleanup()
