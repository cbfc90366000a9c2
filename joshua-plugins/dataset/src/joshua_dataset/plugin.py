"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import PluginSpec, StoreSpec, hookimpl
from joshua.api.specs import EpisodeWriterSpec


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the writers of data sets."""
    return [
        StoreSpec(
            block="data_store",
            enum_values=("FORMAT_HUGGINGFACE", "FORMAT_PARQUET", "FORMAT_CSV", "FORMAT_JSONL"),
            implementation="joshua_dataset.node:DataStore",
            settings="joshua_dataset.settings:StoreSettings",
            summary="records and replays episodes",
        ),
        StoreSpec(
            block="data_store",
            enum_values=("FORMAT_MCAP",),
            implementation="joshua_dataset.node:DataStore",
            settings="joshua_dataset.settings:StoreSettings",
            summary="records every message unchanged",
            all_topics=True,
        ),
        *(
            EpisodeWriterSpec(
                block="data_store",
                enum_values=(value,),
                implementation=f"joshua_dataset.{name}",
                summary=summary,
            )
            for value, name, summary in (
                ("FORMAT_HUGGINGFACE", "writer:LeRobotWriter", "data sets in the layout of LeRobot v3"),
                ("FORMAT_PARQUET", "writer:ParquetWriter", "data sets as Parquet tables"),
                ("FORMAT_CSV", "writer:CsvWriter", "data sets as comma-separated values"),
                ("FORMAT_JSONL", "writer:JsonlWriter", "data sets as JSON lines"),
                ("FORMAT_MCAP", "mcap_writer:McapWriter", "data sets of ROS 2 messages"),
            )
        ),
    ]
