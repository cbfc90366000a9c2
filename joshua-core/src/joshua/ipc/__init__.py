"""What the supervisor and its child processes share: frames, messages, process attributes."""
