"""Settings of SmolVLA, from ``smolvla_config`` and the entry of the model around it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from joshua.api import BlockContext
from joshua_lerobot.settings import PolicySettings


class SmolVlaSettings(PolicySettings):
    """Settings of SmolVLA; every field is optional, and so is the block."""

    kind: ClassVar[str] = "smolvla"
    prefix: ClassVar[str] = "smolvla_config."

    @classmethod
    def si_values(cls, values: Mapping[str, Any], node: Any, context: BlockContext) -> dict[str, Any]:
        """See ``BlockSettings``; the values are those of the model's entry."""
        return super().si_values(values.get("smolvla_config") or {}, node, context)
