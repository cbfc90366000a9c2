"""MuJoCo for JOSHUA: models, simulation modes, simulated hardware."""
