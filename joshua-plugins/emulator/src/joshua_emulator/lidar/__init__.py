"""Emulated laser scanners in a furnished room."""
