"""The page in the browser: a server on loopback, and the files that it serves."""
