"""Recorded motion: one reader for each form of file, all with one result."""
