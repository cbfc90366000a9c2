"""Rotary encoders with a serial link, published as joints."""
