"""An emulated LEGO SPIKE hub: Pybricks over Bluetooth Low Energy, its programs run by MicroPython."""
