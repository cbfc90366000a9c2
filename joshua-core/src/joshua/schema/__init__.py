"""The schema: generated protobuf modules and the DataType table; no logic."""
