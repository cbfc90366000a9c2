"""Evaluation of trained policies: episodes in simulation, figures with intervals, comparison, a report."""
