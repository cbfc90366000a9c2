"""Reinforcement learning on the CPU: PPO and SAC of stable-baselines3 on batched environments."""
