"""Text to ``Config``: load, include, override, positions, and the checks."""
