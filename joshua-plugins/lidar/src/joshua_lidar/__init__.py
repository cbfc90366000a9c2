"""Laser scanners with a serial link: protocol parsers, and one LaserScan per turn."""
