"""Settings of an exported policy, and the check that its files are complete, without onnxruntime."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from joshua.api import FieldError
from joshua.tools import describe_pointer, install
from joshua_lerobot.checkpoint import PICKLES, Checkpoint, CheckpointError, pickled, read_checkpoint
from joshua_lerobot.settings import PolicySettings
from pydantic import model_validator

#: The exported network, and what ``config.json`` says of it: its length in bytes, and what it was made from.
NETWORK = "policy.onnx"
EXPORTED = "onnx"


class OnnxSettings(PolicySettings):
    """Settings of an exported policy, from the block joshua.OnnxPolicy."""

    @model_validator(mode="after")
    def _computes_as_exported(self) -> OnnxSettings:
        if self.compute.precision != "float32":
            raise FieldError(
                "",
                f"An exported policy computes in float32, but compute says {self.compute.precision}",
                remedy="Remove precision, or run the checkpoint that it was exported from",
            )
        return self

    def imports(self, kind: str) -> dict[str, Any]:
        """See ``PolicySettings``."""
        return {"libraries": ("onnxruntime",), "install": f"Install it: {install('joshua-onnx')}"}

    def read(self, folder: Path) -> Checkpoint:
        """See ``PolicySettings``. Raises CheckpointError."""
        return read_exported(folder)


def read_exported(folder: Path) -> Checkpoint:
    """Read the files of an exported policy. Raises CheckpointError."""
    checkpoint = read_checkpoint(folder, weights=NETWORK)
    path = folder / NETWORK
    described: Any = checkpoint.config.get(EXPORTED)
    if not path.is_file() or not isinstance(described, dict):
        pickles = sorted(item.name for item in folder.iterdir() if item.suffix in PICKLES)
        if pickles:
            raise pickled(folder, pickles[0])
        raise CheckpointError(
            f"{folder} contains no exported policy",
            f"Export it: joshua policy export {folder} {folder.with_name(f'{folder.name}_onnx')}",
        )
    if (pointer := describe_pointer(path)) is not None:
        raise CheckpointError(*pointer)
    if path.stat().st_size != described.get("bytes"):
        raise CheckpointError(
            f"{path} has {path.stat().st_size} bytes, but {described.get('bytes')} were exported: the file "
            "was not copied or downloaded to its end",
            "Copy or download the policy again",
        )
    return checkpoint
