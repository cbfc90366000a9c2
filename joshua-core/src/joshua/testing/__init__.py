"""The conformance kit for plugin authors and the pytest fixtures; loads nothing until a check is used."""
