"""An exported policy as a model: radians outside, the units of its training inside."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from joshua.api import JointSpace, Model, ModelError, Observation
from joshua.api.models import Compute, ModelNeeds
from joshua.features import FeatureSet, Unit
from joshua_lerobot.checkpoint import Checkpoint
from joshua_lerobot.loading import lacks_memory
from joshua_lerobot.policy import ArmUnits, needs_of, open_checkpoint

from joshua_onnx.settings import NETWORK, OnnxSettings

FloatArray = npt.NDArray[np.float64]

#: onnxruntime's names of the devices.
PROVIDERS = {
    "cuda": "CUDAExecutionProvider",
    "mps": "CoreMLExecutionProvider",
    "cpu": "CPUExecutionProvider",
}


class OnnxModel(Model):
    """Runs an exported policy; pictures and joints go in unchanged, because normalisation is part of it."""

    settings: OnnxSettings

    def __init__(
        self, settings: OnnxSettings, joints: JointSpace, features: FeatureSet | None = None
    ) -> None:
        super().__init__(settings, joints, features)
        self.units = ArmUnits(joints)
        self._checkpoint: Checkpoint | None = None
        self._session: Any = None
        self._unit = Unit.RADIANS

    def load(self) -> None:
        """Fetch and load the policy. Raises ModelError."""
        self._checkpoint, self._unit = open_checkpoint(self.settings)
        path = self._checkpoint.folder / NETWORK
        self._session = open_session(path.read_bytes(), self.settings.compute, str(path))

    def needs(self) -> ModelNeeds:
        """See ``Model``; by the files that were loaded."""
        return needs_of(self.settings, self._checkpoint)

    def reset(self) -> None:
        """Do nothing: exported policies have no memory."""

    def act(self, observation: Observation) -> FloatArray:
        """See ``Model``. Raises ModelError."""
        if self._session is None or self._checkpoint is None:
            raise ModelError(f"{type(self).__name__}: the policy is not loaded: call load first")
        feed: dict[str, Any] = {}
        for item in self._checkpoint.inputs:
            value = np.asarray(observation[item.key])
            if item.kind != "VISUAL":
                numbers = self.units.given(value, self._unit) if item.kind == "STATE" else value
                value = np.asarray(numbers, np.float32)
            feed[item.key] = value[None]
        try:
            actions = np.asarray(self._session.run(["action"], feed)[0], np.float64)
        except Exception as error:  # of onnxruntime, which has no base class of its own
            raise _failed(f"{self._checkpoint.folder / NETWORK} cannot be run", error) from error
        kept = actions.reshape(-1, actions.shape[-1])[: self.settings.actions_per_chunk or None]
        return self.units.radians(kept, self._unit)

    def close(self) -> None:
        """Free the policy. Idempotent."""
        self._session = None


def open_session(network: bytes, compute: Compute, name: str) -> Any:
    """Open a session of onnxruntime. Raises ModelError for a missing device or a broken network."""
    import onnxruntime

    there = onnxruntime.get_available_providers()
    devices = [device for device, provider in PROVIDERS.items() if provider in there]
    if compute.device not in ("auto", *devices):
        raise ModelError(
            f'device: "{compute.device}" is not available; onnxruntime {onnxruntime.__version__} finds '
            f"{', '.join(devices)}. Install the onnxruntime of that device, such as onnxruntime-gpu, or set "
            'compute { device: "auto" }'
        )
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = compute.threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    chosen = devices if compute.device == "auto" else [compute.device, "cpu"]
    providers = list(dict.fromkeys(PROVIDERS[device] for device in chosen))
    try:
        return onnxruntime.InferenceSession(network, options, providers=providers)
    except Exception as error:  # of onnxruntime, which has no base class of its own
        raise _failed(f"{name} cannot be loaded", error, "Export the policy again") from error


def _failed(what: str, error: Exception, remedy: str = "") -> ModelError:
    said = str(error).strip().partition("\n")[0][:300]
    if lacks_memory(error):
        what, remedy = f"{what}: the memory is too small", "End other programs that use it"
    return ModelError(f"{what}: {said}{'. ' if remedy else ''}{remedy}")
