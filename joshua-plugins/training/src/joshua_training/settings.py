"""Base class of the settings of trainers: one block of ``training``, with its folders."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from joshua.api import BlockContext, BlockSettings


class RunSettings(BlockSettings):
    """Settings of a run: the fields of one block of ``training``, and the environment beside it.

    Attributes:
        environment: name of its enum value, "" if omitted; environment_id: "" if omitted.
        output_folder: absolute, for the folders of runs; resume_run: folder of the run to continue, or "".
    """

    #: Field of ``training`` that holds the block.
    BLOCK: ClassVar[str]

    #: Fields whose omission, or 0, the schema reports by itself.
    REQUIRED: ClassVar[tuple[str, ...]] = ()

    environment: str = ""
    environment_id: str = ""
    output_folder: str = ""
    resume_run: str = ""

    @classmethod
    def si_values(cls, values: Mapping[str, Any], node: Any, context: BlockContext) -> dict[str, Any]:
        """Take the fields of the block, and make folders absolute."""
        del node
        block: Mapping[str, Any] = values[cls.BLOCK] or {}
        folder = Path(context.folder)
        known = {
            name: value
            for name, value in block.items()
            if name in cls.model_fields and value is not None and not (name in cls.REQUIRED and not value)
        }
        known["output_folder"] = str(folder / (block.get("output_folder") or "runs"))
        if block.get("resume_run"):
            known["resume_run"] = str(folder / Path(block["resume_run"]).expanduser())
        return known | {name: values[name] or "" for name in ("environment", "environment_id")}
