"""Data sets for JOSHUA."""
