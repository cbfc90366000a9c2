"""Commands that this plugin adds to ``joshua``."""
