"""Services, parameters, lifecycle states and actions of ROS 2 on the nodes of a run."""
