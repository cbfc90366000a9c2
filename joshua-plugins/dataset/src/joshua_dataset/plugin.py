"""What this distribution provides to the host."""

from __future__ import annotations

from joshua.api import EpisodeWriterSpec, PluginSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the writers of data sets."""
    return [
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
    ]
