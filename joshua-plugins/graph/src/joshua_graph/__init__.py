"""Commands that inspect any running ROS 2 graph."""
