"""Settings of models. A module of its own, because most robots have none and every check takes time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from joshua.plan.model_needs import Compute, ModelNeeds
from joshua.plugins.settings import BlockSettings

if TYPE_CHECKING:
    from google.protobuf.message import Message

    from joshua.plugins.block_context import BlockContext


@dataclass(frozen=True, eq=False, repr=False)
class ModelContext:
    """The entry of a model beside its settings block.

    Attributes:
        weights: folder, file or hub id; "" for none. Local paths are absolute.
        task: of the file; compute: of the file. rate_hz: of the node's published actions.
    """

    weights: str = ""
    task: str = ""
    compute: Compute = field(default_factory=Compute)
    rate_hz: float = 0.0


class ModelSettings(BlockSettings):
    """Base class of the settings of models, with values of their entry beside the block.

    Attributes:
        weights: folder or file, absolute, or a hub id; "" for none.
        task: of the file, "" for none; compute: device and precision of the computation.
        rate_hz: steps of a chunk per second.
    """

    weights: str = ""
    task: str = ""
    compute: Compute = Compute()
    rate_hz: float = 0.0

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: BlockContext
    ) -> dict[str, Any]:
        """Add the values of the model's entry to those of the block."""
        own, entry = super().si_values(values, node, context), context.model or ModelContext()
        known = {"weights": entry.weights, "compute": entry.compute, "rate_hz": entry.rate_hz}
        return own | known | {"task": entry.task or own.get("task", "")}

    def needs(self) -> ModelNeeds:
        """Requirements and abilities of the model, as far as known from its settings and weight files.

        Called during validation, so it must not import anything heavy. Raises FieldError for unusable
        weights. For weights that are not on this machine, the needs stay unknown until the node has loaded
        them.
        """
        return ModelNeeds()
