"""Reinforcement learning in NVIDIA Isaac Lab."""
