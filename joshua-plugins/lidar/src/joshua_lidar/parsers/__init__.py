"""Parsers of scanner streams, one protocol per file: bytes in, measurements out. They do no I/O."""
