"""Commands that this plugin brings."""
