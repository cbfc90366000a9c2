"""What this distribution provides to the host."""

from __future__ import annotations

from joshua.api import EpisodeWriterSpec, PluginSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Names the writer of data sets."""
    return [
        EpisodeWriterSpec(
            block="data_store",
            enum_values=("FORMAT_HUGGINGFACE",),
            implementation="joshua_dataset.lerobot_writer:LeRobotWriter",
            summary="data sets in the layout of LeRobot v3",
        ),
    ]
