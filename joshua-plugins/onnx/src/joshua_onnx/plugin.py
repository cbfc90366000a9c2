"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import ModelSpec, PluginSpec, hookimpl
from joshua_lerobot.plugin import READY_TIMEOUT_S


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the model."""
    return [
        ModelSpec(
            block="joshua.OnnxPolicy",
            message_module="joshua_onnx.onnx_pb2",
            enum_values=("MODEL_PLUGIN",),
            implementation="joshua_onnx.model:OnnxModel",
            settings="joshua_onnx.settings:OnnxSettings",
            ready_timeout_s=READY_TIMEOUT_S,
            summary="policies that were exported to ONNX, without PyTorch",
        )
    ]
