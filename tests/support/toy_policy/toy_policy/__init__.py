"""A plugin of tests: models that take their time, and misbehave where the file says so."""
