"""The command line: reads like a table of contents."""
