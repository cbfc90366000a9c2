"""Declares the plugins of this distribution, without heavy imports."""

from __future__ import annotations

from joshua.api import ModelSpec, PluginSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the random-noise model."""
    return [
        ModelSpec(
            block="random_noise_config",
            enum_values=("RANDOM_NOISE",),
            implementation="joshua_inference.random_noise:RandomNoise",
            settings="joshua_inference.random_noise_settings:RandomNoiseSettings",
            summary="uniformly random joint positions",
        )
    ]
