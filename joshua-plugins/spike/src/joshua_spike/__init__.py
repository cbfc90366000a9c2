"""Driver of LEGO SPIKE hubs that run the Pybricks firmware, over Bluetooth Low Energy."""
