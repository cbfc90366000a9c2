"""Models: what one is, what it observes, and what a chunk continues."""
