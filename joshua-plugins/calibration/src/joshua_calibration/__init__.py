"""Calibrating arms by hand: the procedure, what shows it, and how its result is written."""
