"""Reinforcement learning on accelerators: PPO in JAX, in many environments on MuJoCo XLA."""
