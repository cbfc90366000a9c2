"""Commands that look into any running ROS 2 graph."""
