"""Bounds that keep reading a file quick and its memory small, whatever the file holds."""

from __future__ import annotations

MAX_FILE_BYTES = 8 * 1024 * 1024
MAX_TOKENS = 500_000
MAX_DEPTH = 100  # the depth to which protobuf reads its binary form
MAX_PROBLEMS = 1000
MAX_FILES = 256
MAX_NUMBER_CHARACTERS = 400
