"""Recorded motion: one reader per file format, all with the same result type."""
