"""JOSHUA's work on a Ray cluster."""
