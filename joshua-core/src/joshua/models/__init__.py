"""Models: the base class, their observations, and requests to continue a chunk."""
