"""What comes from a scanner's line, one protocol a file: bytes in, measurements out, no input or output."""
