"""From a checked configuration to a plan: the nodes and their facts."""
