"""A serial range finder and a clamp, examples of a third party's plugin."""
