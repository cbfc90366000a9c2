"""ROS 2 topics over Zenoh, by the conventions of rmw_zenoh."""
