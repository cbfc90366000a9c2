"""``joshua motors``: lists the motors of a bus, and assigns ids one motor at a time."""
