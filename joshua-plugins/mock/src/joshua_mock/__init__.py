"""The mock devices: virtual motors, camera, encoder and laser scanner that need no hardware."""
