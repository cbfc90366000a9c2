"""Parsers for scanners' streams, one protocol per file: bytes in, measurements out, no input or output."""
