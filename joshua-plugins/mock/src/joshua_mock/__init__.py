"""Mock devices that need no hardware: virtual motors, camera, encoder and laser scanner."""
