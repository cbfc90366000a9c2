"""The loop that runs models on a robot, and random noise as the simplest of them."""
