"""What the plugin provides."""

from __future__ import annotations

from joshua.api import ModelSpec, PluginSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Names the model."""
    return [
        ModelSpec(
            block="toy.PolicyConfig",
            enum_values=("MODEL_PLUGIN",),
            implementation="toy_policy.model:ToyPolicy",
            settings="toy_policy.settings:ToySettings",
            message_module="toy_policy.message",
        )
    ]
