"""Writers of data sets by format name."""

from __future__ import annotations

from joshua_dataset.mcap_writer import McapWriter
from joshua_dataset.writer import CsvWriter, DatasetWriter, JsonlWriter, LeRobotWriter, ParquetWriter

_WRITERS: dict[str, type[DatasetWriter]] = {
    kind.format: kind for kind in (LeRobotWriter, ParquetWriter, CsvWriter, JsonlWriter, McapWriter)
}


def writer_of(table_format: str) -> type[DatasetWriter]:
    """Return the writer of a format. Raises KeyError."""
    return _WRITERS[table_format]
