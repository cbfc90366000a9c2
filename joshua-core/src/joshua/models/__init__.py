"""Models: the base class, the node that runs one, and random noise as the simplest of them."""
