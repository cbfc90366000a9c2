"""Gamepads and the keyboard as input devices for driving joints."""
