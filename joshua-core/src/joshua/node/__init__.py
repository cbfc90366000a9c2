"""The runtime inside a child process: lifecycle, timers, endpoints, the entry point."""
