"""Carries out a plan: spawns the nodes as child processes, watches, restarts and stops them."""
