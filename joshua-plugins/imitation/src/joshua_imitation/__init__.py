"""Imitation learning: policies of LeRobot learn from recorded episodes."""
