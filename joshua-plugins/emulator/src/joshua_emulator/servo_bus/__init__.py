"""What the emulated servo buses of all families have in common."""
