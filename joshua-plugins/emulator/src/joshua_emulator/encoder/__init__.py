"""Emulated rotary encoders on a shaft that turns back and forth over several turns."""
