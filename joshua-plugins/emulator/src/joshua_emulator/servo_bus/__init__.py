"""Common parts of all emulated servo buses."""
