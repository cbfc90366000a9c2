"""Runs of trainings: their folders, checkpoints and metrics."""
