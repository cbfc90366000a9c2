"""Bounds of time and memory for reading any file."""

from __future__ import annotations

MAX_FILE_BYTES = 8 * 1024 * 1024
MAX_TOKENS = 500_000
MAX_DEPTH = 100  # the limit of protobuf's binary format
MAX_PROBLEMS = 1000
MAX_FILES = 256
MAX_INCLUDE_DEPTH = 32  # of files that include one another
MAX_NUMBER_CHARACTERS = 400
