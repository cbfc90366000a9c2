"""The program that runs on the hub: source, compiled form and packaging."""
