"""From a checked configuration to a plan: which nodes start, and what each is told."""
