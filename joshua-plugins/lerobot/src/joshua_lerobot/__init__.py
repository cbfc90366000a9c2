"""Policies of LeRobot on a robot: reading a checkpoint, checking it against the robot, running it."""
