"""A policy of LeRobot as a model: radians outside, the checkpoint's units inside."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from joshua.api import FieldError, JointRange, JointSpace, Model, ModelError, Observation
from joshua.api.models import ChunkRequest, ModelNeeds
from joshua.features import FeatureSet, JointUnits, Unit

from joshua_lerobot.checkpoint import Checkpoint, CheckpointError
from joshua_lerobot.hub import fetch, is_hub_id
from joshua_lerobot.loading import (
    LoadedPolicy,
    lacks_memory,
    load_policy,
    not_compiled,
    out_of_memory,
)
from joshua_lerobot.settings import PREDICTS_CHUNKS, PolicySettings

FloatArray = npt.NDArray[np.float64]

_LOG = logging.getLogger(__name__)

_NS_PER_S = 1_000_000_000

#: Largest interval between consecutive observations, in periods.
_SUCCESSIVE = 1.5


class LeRobotModel(Model):
    """Runs a policy with the processors of its checkpoint.

    Policies that look back (Diffusion, VQ-BeT) see the observations of earlier periods; the first one of an
    episode stands for those before it, as with LeRobot. Those that plan (TDMPC) continue their last plan if
    requests follow one another at the rate of the actions.
    """

    settings: PolicySettings

    def __init__(
        self, settings: PolicySettings, joints: JointSpace, features: FeatureSet | None = None
    ) -> None:
        super().__init__(settings, joints, features)
        self.units = ArmUnits(joints)
        self._checkpoint: Checkpoint | None = None
        self._loaded: LoadedPolicy | None = None
        self._unit = Unit.RADIANS
        self._last_ns = 0

    def load(self) -> None:
        """Fetch and load the policy. Raises ModelError."""
        self._checkpoint, self._unit = open_checkpoint(self.settings)
        self._loaded = load_policy(self._checkpoint, self.settings)
        if self._checkpoint.unnormalised:
            _LOG.warning(
                "%s has no statistics of %s, which are not normalised, as allow_unnormalized permits",
                self._checkpoint.folder,
                ", ".join(self._checkpoint.unnormalised),
            )
        coefficient = self._checkpoint.config.get("temporal_ensemble_coeff")
        if coefficient is not None:
            _LOG.info(
                "the checkpoint was evaluated with execution { strategy: TEMPORAL_ENSEMBLE "
                "ensemble_coefficient: %s }",
                coefficient,
            )

    def needs(self) -> ModelNeeds:
        """See ``Model``; by the files that were loaded."""
        return needs_of(self.settings, self._checkpoint)

    def reset(self) -> None:
        """Forget the episode so far; the same ``compute.seed`` draws the same noise again."""
        loaded = self._ready()
        loaded.policy.reset()
        self._last_ns = 0
        if self.settings.compute.seed is not None:
            import torch

            torch.manual_seed(self.settings.compute.seed)

    def act(self, observation: Observation) -> FloatArray:
        """See ``Model``. Raises ModelError."""
        return self._guarded(lambda loaded, kind: self._chunk(loaded, kind, observation))

    def continue_chunk(self, observation: Observation, request: ChunkRequest) -> FloatArray:
        """See ``Model``; by the real-time chunking of LeRobot. Raises ModelError."""
        return self._guarded(lambda loaded, kind: self._continued(loaded, observation, request))

    def close(self) -> None:
        """Free the policy. Idempotent."""
        loaded, self._loaded = self._loaded, None
        if loaded is not None and loaded.device.type == "cuda":
            import torch

            torch.cuda.empty_cache()

    def _guarded(self, compute: Callable[[LoadedPolicy, str], Any]) -> FloatArray:
        import torch

        loaded = self._ready()
        assert self._checkpoint is not None
        try:
            with torch.no_grad(), loaded.precision():
                actions = compute(loaded, self._checkpoint.type)
        except (MemoryError, RuntimeError) as error:
            if lacks_memory(error):
                raise out_of_memory(loaded.device) from error
            if not self.settings.compile or not isinstance(error, torch._dynamo.exc.TorchDynamoException):
                raise
            raise not_compiled(error) from error
        return self._in_radians(loaded, actions)

    def _ready(self) -> LoadedPolicy:
        if self._loaded is None:
            raise ModelError(f"{type(self).__name__}: the policy is not loaded: call load first")
        return self._loaded

    def _chunk(self, loaded: LoadedPolicy, kind: str, observation: Observation) -> Any:
        """Return a chunk in the policy's own scale, shape (1, T, N)."""
        batch = loaded.before(self._batch(observation))
        if kind in PREDICTS_CHUNKS:
            return loaded.policy.predict_action_chunk(batch)[:, : self._steps()]
        follows = self._follows(observation)
        if observation.earlier or not follows:
            loaded.policy.reset()
        for seen in reversed(observation.earlier):
            _shown(loaded.policy, loaded.before(self._batch(seen)))
        return _drained(loaded.policy, batch)

    def _continued(self, loaded: LoadedPolicy, observation: Observation, request: ChunkRequest) -> Any:
        import torch
        from lerobot.configs.types import RTCAttentionSchedule
        from lerobot.policies.rtc.configuration_rtc import RTCConfig

        policy = loaded.policy
        policy.config.rtc_config = RTCConfig(
            enabled=True,
            prefix_attention_schedule=RTCAttentionSchedule(request.schedule.upper()),
            max_guidance_weight=request.max_guidance_weight,
            execution_horizon=request.overlap,
        )
        policy.init_rtc_processor()
        planned = torch.from_numpy(self.units.given(request.planned, self._unit).astype(np.float32))
        try:
            chunk = policy.predict_action_chunk(
                loaded.before(self._batch(observation)),
                inference_delay=request.delay,
                prev_chunk_left_over=_normalised(loaded.before, planned).to(loaded.device),
                execution_horizon=request.overlap,
            )
        finally:
            policy.config.rtc_config = None
            policy.init_rtc_processor()
        return chunk

    def _batch(self, observation: Observation) -> dict[str, Any]:
        """Convert an observation for LeRobot's processors: pictures (1, C, H, W), 0 to 1, numbers (1, N)."""
        import torch

        assert self._checkpoint is not None
        batch: dict[str, Any] = {}
        for item in self._checkpoint.inputs:
            if item.key not in observation.values:
                continue
            value = observation[item.key]
            if item.kind == "VISUAL":
                picture = torch.from_numpy(np.array(value)).to(torch.float32) / 255
                batch[item.key] = picture.permute(2, 0, 1).contiguous().unsqueeze(0)
            else:
                if item.kind == "STATE":
                    value = self.units.given(value, self._unit)
                batch[item.key] = torch.from_numpy(np.array(value, np.float32)).unsqueeze(0)
        if observation.task:
            batch["task"] = observation.task
        return batch

    def _in_radians(self, loaded: LoadedPolicy, actions: Any) -> FloatArray:
        import torch

        steps = loaded.after(actions.to(torch.float32))
        values = np.asarray(steps.detach().cpu().numpy(), np.float64)
        return self.units.radians(values.reshape(-1, values.shape[-1]), self._unit)

    def _steps(self) -> int | None:
        """Return how many actions of a chunk are used; None for all."""
        assert self._checkpoint is not None
        kept = self.settings.actions_per_chunk or int(self._checkpoint.config.get("n_action_steps") or 0)
        return kept or None

    def _follows(self, observation: Observation) -> bool:
        """Return whether an observation directly follows the last one."""
        period_ns = _NS_PER_S / (self.settings.rate_hz or 1.0)
        follows = 0 < observation.stamp_ns - self._last_ns < _SUCCESSIVE * period_ns
        self._last_ns = observation.stamp_ns
        return follows


class ArmUnits:
    """Joints that a model commands, in radians and in the units of a checkpoint, shape (…, N)."""

    def __init__(self, joints: JointSpace) -> None:
        ends = zip(joints.names, joints.position_min_rad, joints.position_max_rad, strict=True)
        # The numbers keep apart joints of two arms that have one name; grippers stay what they are.
        ranges = [JointRange(f"{i}_{name}", float(a), float(b)) for i, (name, a, b) in enumerate(ends)]
        self._ranges = ranges

    def given(self, position_rad: npt.ArrayLike, unit: Unit) -> FloatArray:
        """Convert positions to the units of the policy."""
        position = np.asarray(position_rad, np.float64)
        if unit is Unit.RADIANS:
            return position
        return JointUnits.from_ranges(self._ranges).from_radians(position, unit)

    def radians(self, values: FloatArray, unit: Unit) -> FloatArray:
        """Convert positions of the policy to radians."""
        if unit is Unit.RADIANS:
            return values
        return JointUnits.from_ranges(self._ranges).to_radians(values, unit)


def open_checkpoint(settings: PolicySettings) -> tuple[Checkpoint, Unit]:
    """Fetch and read a checkpoint. Raises ModelError."""
    folder = Path(settings.weights)
    if not folder.exists() and is_hub_id(settings.weights):
        try:
            folder = fetch(settings.weights, settings.revision)
        except CheckpointError as error:  # the hub may be reached later
            raise ModelError(str(error)) from error
    try:
        checkpoint = settings.read(folder)
        # A checkpoint of the hub may not have been here when the file was checked.
        settings.needs_of(checkpoint)
        return checkpoint, Unit(settings.unit_of(checkpoint))
    except CheckpointError as error:
        raise ModelError(str(error), is_permanent=True) from error
    except FieldError as error:
        raise ModelError(f"{error}. {error.remedy}", is_permanent=True) from error


def needs_of(settings: PolicySettings, checkpoint: Checkpoint | None) -> ModelNeeds:
    """Return what a model needs, from the files that were loaded. Raises ModelError."""
    if checkpoint is None:
        return settings.needs()
    try:
        return settings.needs_of(checkpoint)
    except FieldError as error:
        raise ModelError(f"{error}. {error.remedy}") from error


def _shown(policy: Any, batch: dict[str, Any]) -> None:
    """Add an observation to a policy with queues; a waiting action keeps it from predicting."""
    policy._queues["action"].append(None)
    policy.select_action(batch)


def _drained(policy: Any, batch: dict[str, Any]) -> Any:
    """Return all actions that a policy with its own queue makes from one observation, shape (1, T, N)."""
    import torch

    actions = [policy.select_action(batch)]
    queue = getattr(policy, "_queues", {}).get("action")
    while queue:
        actions.append(queue.popleft())
    return torch.stack([action.reshape(1, -1) for action in actions], dim=1)


def _normalised(before: Any, actions: Any) -> Any:
    """Convert actions from the data set's scale to the policy's own with the checkpoint's normaliser."""
    from lerobot.processor import NormalizerProcessorStep, TransitionKey
    from lerobot.processor.converters import create_transition

    for step in before.steps:
        if isinstance(step, NormalizerProcessorStep):
            return step(create_transition(action=actions))[TransitionKey.ACTION]
    return actions
