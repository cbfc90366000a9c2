"""``joshua motors``: what is on a bus, and giving motors their ids one at a time."""
