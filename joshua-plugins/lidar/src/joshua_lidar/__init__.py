"""Laser scanners with a serial link: parsers of their protocols, and one LaserScan a turn."""
