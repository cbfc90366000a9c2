"""What this distribution provides to the host."""

from __future__ import annotations

from joshua.api import EpisodeWriterSpec, PluginSpec, StoreSpec, hookimpl


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
        *(
            EpisodeWriterSpec(
                block="data_store",
                enum_values=(value,),
                implementation=f"joshua_dataset.writer:{name}",
                summary=summary,
            )
            for value, name, summary in (
                ("FORMAT_HUGGINGFACE", "LeRobotWriter", "data sets in the layout of LeRobot v3"),
                ("FORMAT_PARQUET", "ParquetWriter", "data sets as Parquet tables"),
                ("FORMAT_CSV", "CsvWriter", "data sets as comma-separated values"),
                ("FORMAT_JSONL", "JsonlWriter", "data sets as lines of JSON"),
            )
        ),
    ]
