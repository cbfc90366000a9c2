"""Gamepads and the keyboard: a person drives."""
