"""The browser page: a server on loopback and the files that it serves."""
