"""Emulated laser scanners in a room with things in it."""
