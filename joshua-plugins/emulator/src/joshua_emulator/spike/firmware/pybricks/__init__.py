"""What the emulated hub offers its programs; runs under MicroPython."""
